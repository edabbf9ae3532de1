# Sources and functions for the images of every part of the PSoC 4 family. The part's CMakeLists.txt sets PART_RAM and,
# where the part needs them, PART_MACRO and PART_BOOTLOADER (sources) before it includes this file.
set(CMAKE_C_STANDARD 11)
set(CMAKE_C_STANDARD_REQUIRED ON)
set(HERE ${CMAKE_CURRENT_SOURCE_DIR}) # folder of the part
set(FIRMWARE ${HERE}/../..)
set(TOOLS ${FIRMWARE}/../tools/firmware)
set(TAXEL_PYTHON python3 CACHE STRING "Python with the taxel package")
set(FAMILY ${CMAKE_CURRENT_LIST_DIR})

# -Os: flash is scarce. -flto: 6 to 11 % smaller. Three passes that make Cortex-M0 code larger are off: 1 % (all
# measured, GCC 12.2).
# -fno-delete-null-pointer-checks: the flash begins at address 0.
set(OPTIMIZE -Os -flto -fno-expensive-optimizations -fno-ipa-cp -fno-ipa-sra)
add_compile_options(${OPTIMIZE} -ffreestanding -fno-delete-null-pointer-checks -ffunction-sections -fdata-sections
    -fno-common -Wall -Wextra -Wconversion -Wshadow -Wstrict-prototypes -Werror -ffile-prefix-map=${FIRMWARE}=firmware)
# The linker makes the code: -fstack-usage writes IMAGE.elf.ltrans0.ltrans.su beside the image, for the size tool.
add_link_options(${OPTIMIZE} -flto-partition=one -fdata-sections -fstack-usage -save-temps=obj -nostdlib -nostartfiles
    -Wl,--nmagic -Wl,--gc-sections -Wl,--fatal-warnings -Wl,--no-warn-rwx-segments)

set(HEADERS ${CMAKE_CURRENT_BINARY_DIR}/generated)
add_custom_command(
    OUTPUT ${HEADERS}/sensor/board_pins.h ${HEADERS}/hub/board_pins.h ${HEADERS}/kinds.c
    COMMAND ${TAXEL_PYTHON} ${TOOLS}/board_header.py --pins ${HERE}/pins.toml --out ${HEADERS}
    DEPENDS ${HERE}/pins.toml ${TOOLS}/board_header.py
    VERBATIM)
add_custom_target(board_headers DEPENDS ${HEADERS}/kinds.c)

set(FAULT ${FAMILY}/fault.c)
set(COMMON ${FAMILY}/startup.c ${FAMILY}/ticks.c ${HERE}/watchdog.c ${FAMILY}/reset.c ${HERE}/flash_rows.c)
set(APPLICATION ${FAULT} ${FAMILY}/self.c ${HERE}/clocks.c ${FIRMWARE}/codec/crc32_small.c ${FIRMWARE}/bootloader/confirm.c
    ${FIRMWARE}/bootloader/metadata.c ${FIRMWARE}/bootloader/record.c ${FIRMWARE}/bootloader/config_rows.c
    ${FIRMWARE}/bootloader/layout.c)
set(SENSOR ${FAMILY}/sensor_main.c ${FAMILY}/lines.c ${FAMILY}/i2c_slave.c ${HERE}/front_end.c ${HEADERS}/kinds.c
    ${FIRMWARE}/sensor/sensor.c ${FIRMWARE}/sensor/scan.c ${FIRMWARE}/sensor/slave.c
    ${FIRMWARE}/sensor/compact.c ${FIRMWARE}/codec/compact_model.c ${FIRMWARE}/codec/compact_encode.c)
set(HUB ${FAMILY}/hub_main.c ${FAMILY}/i2c_master.c ${FAMILY}/uart.c ${FIRMWARE}/codec/encoder.c ${FIRMWARE}/hub/hub.c
    ${FIRMWARE}/hub/schedule.c ${FIRMWARE}/hub/launch.c ${FIRMWARE}/hub/outcome.c ${FIRMWARE}/hub/snapshot.c
    ${FIRMWARE}/hub/identify.c ${FIRMWARE}/hub/recovery.c
    ${FIRMWARE}/hub/outbox.c ${FIRMWARE}/hub/pool.c ${FIRMWARE}/hub/stall.c
    ${FIRMWARE}/hub/inbox.c ${FIRMWARE}/hub/command.c ${FIRMWARE}/hub/report.c)
set(BOOTLOADER ${FAMILY}/boot_main.c ${FAMILY}/crc32_tiny.c ${PART_BOOTLOADER})
foreach(name bootloader choose commands config_rows image layout metadata packet record reports rows search)
    list(APPEND BOOTLOADER ${FIRMWARE}/bootloader/${name}.c)
endforeach()

add_library(memory OBJECT ${FAMILY}/memory.c)
target_compile_options(memory PRIVATE -fno-lto -fstack-usage -fno-builtin -fno-tree-loop-distribute-patterns)

# add_image(NAME name PINS folder DEVICE 1|2 [SLOT 0|1 | FIRST_ROW row END_ROW row] [ONE_SLOT] RAM bytes STACK bytes
#           SOURCES ...)
# FIRST_ROW, END_ROW: a standalone image, without slots. ONE_SLOT: for a part with 16 KiB of flash and slot A only.
function(add_image)
    cmake_parse_arguments(IMAGE "ONE_SLOT" "NAME;PINS;DEVICE;SLOT;FIRST_ROW;END_ROW;RAM;STACK" "SOURCES" ${ARGN})
    set(macros -DIMAGE_DEVICE=${IMAGE_DEVICE} -DRAM_BUDGET=${IMAGE_RAM} -DSTACK=${IMAGE_STACK})
    if(DEFINED IMAGE_SLOT)
        list(APPEND macros -DIMAGE_SLOT=${IMAGE_SLOT})
    endif()
    if(DEFINED IMAGE_FIRST_ROW)
        list(APPEND macros -DIMAGE_STANDALONE -DIMAGE_FIRST_ROW=${IMAGE_FIRST_ROW} -DIMAGE_END_ROW=${IMAGE_END_ROW})
    endif()
    if(IMAGE_ONE_SLOT)
        list(APPEND macros -DTAXEL_BOOT_ONE_SLOT)
    elseif(PART_MACRO)
        list(APPEND macros -D${PART_MACRO})
    endif()
    string(JOIN " " macro_text ${macros})
    set(script ${CMAKE_CURRENT_BINARY_DIR}/${IMAGE_NAME}.ld)
    # The header's constants end in u, which the linker does not read.
    set(preprocess "${CMAKE_C_COMPILER} -E -P -x c ${macro_text} -I${FIRMWARE} -I${HERE} -imacros generated/taxel_bootloader.h -imacros part/numbers.h")
    set(strip "sed -E 's/\\b(0x[0-9A-Fa-f]+|[0-9]+)u\\b/\\1/g'")
    add_custom_command(
        OUTPUT ${script}
        COMMAND sh -c "${preprocess} ${FAMILY}/image.ld.in | ${strip} > ${script}"
        DEPENDS ${FAMILY}/image.ld.in ${FIRMWARE}/generated/taxel_bootloader.h ${HERE}/part/numbers.h
        VERBATIM)
    add_executable(${IMAGE_NAME} ${IMAGE_SOURCES} ${COMMON} $<TARGET_OBJECTS:memory> ${script})
    add_dependencies(${IMAGE_NAME} board_headers)
    set_target_properties(${IMAGE_NAME} PROPERTIES SUFFIX .elf LINK_DEPENDS ${script})
    target_include_directories(${IMAGE_NAME} PRIVATE ${FIRMWARE} ${HERE} ${HEADERS}/${IMAGE_PINS})
    target_compile_definitions(${IMAGE_NAME} PRIVATE IMAGE_DEVICE=${IMAGE_DEVICE} TAXEL_HUB_FIXED_CONFIG)
    if(IMAGE_ONE_SLOT)
        target_compile_definitions(${IMAGE_NAME} PRIVATE TAXEL_BOOT_ONE_SLOT)
    elseif(PART_MACRO)
        target_compile_definitions(${IMAGE_NAME} PRIVATE ${PART_MACRO})
    endif()
    if(DEFINED IMAGE_SLOT)
        target_compile_definitions(${IMAGE_NAME} PRIVATE IMAGE_APPLICATION)
    elseif(DEFINED IMAGE_FIRST_ROW)
        target_compile_definitions(${IMAGE_NAME} PRIVATE IMAGE_APPLICATION IMAGE_STANDALONE)
    endif()
    target_compile_options(${IMAGE_NAME} PRIVATE -frandom-seed=${IMAGE_NAME})
    target_link_options(${IMAGE_NAME} PRIVATE -T ${script} -frandom-seed=${IMAGE_NAME} -Wl,-Map=${IMAGE_NAME}.map)
    target_link_libraries(${IMAGE_NAME} PRIVATE gcc)
endfunction()

add_image(NAME bootloader-board PINS sensor DEVICE 1 RAM ${PART_RAM} STACK 1024
    SOURCES ${BOOTLOADER} ${FIRMWARE}/bootloader/i2c.c ${FAMILY}/i2c_slave.c)
add_image(NAME bootloader-hub PINS hub DEVICE 2 RAM ${PART_RAM} STACK 1024
    SOURCES ${BOOTLOADER} ${FIRMWARE}/bootloader/i2c.c ${FIRMWARE}/bootloader/uart.c ${FAMILY}/uart.c)
add_image(NAME board-a PINS sensor DEVICE 1 SLOT 0 RAM ${PART_RAM} STACK 960 SOURCES ${SENSOR} ${APPLICATION})
add_image(NAME board-b PINS sensor DEVICE 1 SLOT 1 RAM ${PART_RAM} STACK 960 SOURCES ${SENSOR} ${APPLICATION})
add_image(NAME hub-a PINS hub DEVICE 2 SLOT 0 RAM ${PART_RAM} STACK 768 SOURCES ${HUB} ${APPLICATION})
add_image(NAME hub-b PINS hub DEVICE 2 SLOT 1 RAM ${PART_RAM} STACK 768 SOURCES ${HUB} ${APPLICATION})

# Files for a programmer and a host: images/DEVICE-{a,b}.{bin,hex,cyacd}, DEVICE.toml, DEVICE-factory.hex.
# Each file has a signature (.sig): of TAXEL_SIGNING_KEY, or of the development key, which only the emulator accepts.
set(TAXEL_SIGNING_KEY "" CACHE FILEPATH "Private key (taxel keygen) of the signatures; empty: the development key")
set(SIGNING_OPTION "")
if(TAXEL_SIGNING_KEY)
    set(SIGNING_OPTION --key ${TAXEL_SIGNING_KEY})
endif()
set(IMAGES ${CMAKE_CURRENT_BINARY_DIR}/images)
foreach(device board hub)
    add_custom_command(
        OUTPUT ${IMAGES}/${device}.toml
        COMMAND ${TAXEL_PYTHON} ${TOOLS}/firmware_image.py --bootloader bootloader-${device}.elf
                --slot-a ${device}-a.elf --slot-b ${device}-b.elf --name ${device} --out ${IMAGES} ${SIGNING_OPTION}
        DEPENDS bootloader-${device} ${device}-a ${device}-b ${TOOLS}/firmware_image.py ${TOOLS}/firmware_elf.py
                ${FIRMWARE}/../host/taxel/version.py
        VERBATIM)
    list(APPEND MANIFESTS ${IMAGES}/${device}.toml)
endforeach()
add_custom_target(images ALL DEPENDS ${MANIFESTS})

