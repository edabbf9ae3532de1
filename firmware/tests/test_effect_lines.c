/* Lines `effect NAME FORM key=value ...`: every invalid line is rejected with one line on stderr. */
#define _GNU_SOURCE
#include "rejection.h"

#define MAP_3 "0700000000000000000000000000000000000000000000000000000000000000"
#define WORLD "taxel-world 1\nboard 32 1 1 3 3 " MAP_3 " 0102030405060708 0 5\n"

static void valid_effect_lines_are_read(void)
{
    static struct world_description world;
    static struct rejection rejection;
    unsigned lines;
    CHECK_EQUAL(rejection_read(&rejection, &world,
                               WORLD
                               "effect spread film length_m=0.002\n"
                               "effect rheology play width_m=1e-4 fraction=0.2 creep=0.1 seconds=2\n"
                               "effect indent set fraction=0.1 threshold_m=1e-4 recovery_s=120\n"
                               "effect proximity wedge share=0.2 reach_m=0.001\n"
                               "effect moisture drying board=0x20 tx=0 rx=1.5 radius_m=0.01 water=0.1 seconds=60\n"
                               "effect modulus taxels log_std=0.2\neffect modulus board board=32 factor=2\n",
                               &lines),
                0);
    CHECK_EQUAL(lines, 0);
    CHECK(world.effects.spread.strength == 1.0 && world.effects.spread.length_m == 0.002);
    CHECK(world.effects.rheology.form == RHEOLOGY_PLAY && world.effects.rheology.seconds == 2.0);
    CHECK(world.effects.indent.form == INDENT_SET && world.effects.indent.recovery_s == 120.0);
    CHECK(world.effects.proximity.form == PROXIMITY_WEDGE && world.effects.proximity.share == 0.2);
    CHECK(world.effects.moisture.form == MOISTURE_DRYING && world.effects.moisture.rx == 1.5);
    CHECK(world.effects.modulus.log_std == 0.2 && world.effects.modulus.log_factor[32] > 0.69);
    world_file_free(&world);
}

static const char *const invalid_lines[] = {
    WORLD "effect\n",
    WORLD "effect spread\n",
    WORLD "effect sprad film length_m=0.002\n",
    WORLD "effect spread sheet length_m=0.002\n",
    WORLD "effect spread film\n",
    WORLD "effect spread film length_m\n",
    WORLD "effect spread film length_m=\n",
    WORLD "effect spread film length_m=2mm\n",
    WORLD "effect spread film length_m=nan\n",
    WORLD "effect spread film length_m=1\n",
    WORLD "effect spread film length_m=-0.001\n",
    WORLD "effect spread film length_m=0.002 strenght=1\n",
    WORLD "effect spread film length_m=0.002 slope=1\n",
    WORLD "effect spread film length_m=0.002 strength=2\n",
    WORLD "effect spread film length_m=0.002 length_m=0.003\n",
    WORLD "effect spread film length_m=0.002 and more\n",
    WORLD "effect rheology solid fraction=0.2\n",
    WORLD "effect rheology solid seconds=1\n",
    WORLD "effect rheology solid fraction=0.2 seconds=0\n",
    WORLD "effect rheology play fraction=0.2 seconds=1\n",
    WORLD "effect rheology solid fraction=0.2 seconds=1 width_m=1e-4\n",
    WORLD "effect indent set fraction=0.1\n",
    WORLD "effect indent set fraction=0.1 threshold_m=1e-4 recovery_s=0\n",
    WORLD "effect indent bedding fraction=0.1 work_j_m2=-1\n",
    WORLD "effect proximity image share=0.1\n",
    WORLD "effect proximity image share=1.1 reach_m=0.004\n",
    WORLD "effect proximity conductor share=0.1 reach_m=0.004 grounding=1.1\n",
    WORLD "effect proximity conductor share=0.1 reach_m=0.004 permittivity=3\n",
    WORLD "effect proximity dielectric share=0.1 reach_m=0.004\n",
    WORLD "effect proximity dielectric share=0.1 reach_m=0.004 permittivity=0.9\n",
    WORLD "effect proximity dielectric share=0.1 reach_m=0.004 permittivity=3 thickness_m=0\n",
    WORLD "effect proximity image share=0.1 reach_m=0.004 grounding=1\n",
    WORLD "effect moisture film tx=0 rx=0 radius_m=0.01 water=0.1\n",
    WORLD "effect moisture film board=0x21 tx=0 rx=0 radius_m=0.01 water=0.1\n",
    WORLD "effect moisture film board=x tx=0 rx=0 radius_m=0.01 water=0.1\n",
    WORLD "effect moisture film board=0x20 tx=0 rx=0 radius_m=0.01 water=0.9\n",
    WORLD "effect moisture drying board=0x20 tx=0 rx=0 radius_m=0.01 water=0.1\n",
    WORLD "effect moisture film board=0x20 tx=0 rx=0 radius_m=0.01 water=0.1 seconds=3\n",
    WORLD "effect modulus taxels\n",
    WORLD "effect modulus taxels log_std=0.1 board=0x20\n",
    WORLD "effect modulus board factor=2\n",
    WORLD "effect modulus board board=0x20 factor=0\n",
    "taxel-world 1\neffect moisture film board=0x20 tx=0 rx=0 radius_m=0.01 water=0.1\n",
};

static void invalid_effect_lines_are_rejected_with_one_line(void)
{
    rejection_check_all(invalid_lines, sizeof invalid_lines / sizeof invalid_lines[0]);
}

static void an_error_message_names_the_effect_and_the_key(void)
{
    static struct world_description world;
    static struct rejection rejection;
    unsigned lines;
    CHECK_EQUAL(rejection_read(&rejection, &world, WORLD "effect spread film length_m=1\n", &lines), -1);
    CHECK(strstr(rejection.text, "line 3") && strstr(rejection.text, "spread") && strstr(rejection.text, "length_m=1"));
    world_file_free(&world);
    CHECK_EQUAL(rejection_read(&rejection, &world, WORLD "effect rheology fluid fraction=0\n", &lines), -1);
    CHECK(strstr(rejection.text, "solid, play"));
    world_file_free(&world);
}

int main(void)
{
    RUN(valid_effect_lines_are_read);
    RUN(invalid_effect_lines_are_rejected_with_one_line);
    RUN(an_error_message_names_the_effect_and_the_key);
    return check_summary();
}
