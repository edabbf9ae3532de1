#include "sensor/sensor.h"

#include "codec/crc32.h"

/* Count the bits set in a crossing map of TAXEL_CROSSING_MAP_SIZE bytes: the number of taxels. */
static uint16_t count_bits(const uint8_t *map)
{
    uint16_t bits = 0;
    for (size_t i = 0; i < TAXEL_CROSSING_MAP_SIZE; i++) {
        for (uint8_t byte = map[i]; byte; byte &= (uint8_t)(byte - 1u)) {
            bits++;
        }
    }
    return bits;
}

/* Return whether the crossing map has no bit set beyond the crossings of the board. */
static bool map_fits(const struct taxel_sensor_config *config)
{
    for (unsigned crossing = (unsigned)config->rows * config->columns; crossing < 8u * TAXEL_CROSSING_MAP_SIZE;
         crossing++) {
        if (config->crossing_map[crossing >> 3] & (1u << (crossing & 7u))) {
            return false;
        }
    }
    return true;
}

/* Return whether the numbers of lines and taxels, the address, the crossing map and the scan settings are permitted and
 * consistent. */
static bool config_is_valid(const struct taxel_sensor_config *config)
{
    return config->rows >= 1u && config->rows <= TAXEL_LINES_MAX && config->columns >= 1u &&
           config->columns <= TAXEL_LINES_MAX && config->taxel_count >= 1u && config->taxel_count <= TAXEL_TAXELS_MAX &&
           config->address >= TAXEL_ADDRESS_MIN && config->address <= TAXEL_ADDRESS_MAX &&
           count_bits(config->crossing_map) == config->taxel_count && map_fits(config) &&
           taxel_front_end_accepts(config->hal, &config->settings);
}

/* Write the identity register with its CRC-32. The register-map version is the lower one if the board has no compact
 * snapshots. */
static void fill_identity(struct taxel_sensor *sensor)
{
    const struct taxel_sensor_config *config = sensor->config;
    struct taxel_identity identity = {
        .who_am_i = TAXEL_WHO_AM_I,
        .map_version = taxel_sensor_has_compact(sensor) ? TAXEL_REGISTER_MAP_VERSION : TAXEL_REGISTER_MAP_VERSION_MIN,
        .firmware_major = config->firmware_version[0],
        .firmware_minor = config->firmware_version[1],
        .firmware_patch = config->firmware_version[2],
        .kind = config->kind,
        .address = config->address,
        .map_revision = TAXEL_REGISTER_MAP_REVISION,
        .rows = config->rows,
        .columns = config->columns,
        .taxel_count = config->taxel_count,
        .snapshot_size = (uint16_t)TAXEL_SNAPSHOT_SIZE(config->taxel_count),
    };
    memcpy(identity.unique_id, config->unique_id, sizeof identity.unique_id);
    memcpy(identity.crossing_map, config->crossing_map, sizeof identity.crossing_map);
    taxel_identity_pack(&identity, sensor->identity);
    identity.crc32 = taxel_crc32(0, sensor->identity, TAXEL_IDENTITY_OFFSET_CRC32);
    taxel_identity_pack(&identity, sensor->identity);
}

/* Initialise the board, which does not scan yet. `config` must stay valid. Returns 0, or TAXEL_ERROR_INVALID if
 * address, crossing map, sizes or settings are invalid. */
int taxel_sensor_init(struct taxel_sensor *sensor, const struct taxel_sensor_config *config)
{
    if (!config_is_valid(config)) {
        return TAXEL_ERROR_INVALID;
    }
    memset(sensor, 0, sizeof *sensor);
    sensor->config = config;
    sensor->settings = config->settings;
    sensor->scan.scanning = config->snapshots[0];
    sensor->scan.newest = config->snapshots[1];
    sensor->scan.latched = config->snapshots[2];
    taxel_sensor_compact_init(sensor);
    fill_identity(sensor);
    config->hal->front_end_configure(config->hal->context, &sensor->settings);
    return 0;
}
