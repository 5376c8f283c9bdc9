/* Relights the atlas of scene.h, says hashes of what comes out, and checks what has to be refused.
 *
 * The same program runs on a desktop and on bare metal: `say` prints a name and a number, and `instructions`
 * counts where there is a counter (startup.c), and is 0 elsewhere. */

#include "relume.h"
#include "room.h"
#include "scene.h"

void say(const char *name, uint32_t value);
uint32_t instructions(void);
uint32_t largest_stack(void);

static RelumeAtlas atlas;
static RelumeFrame frame;
static uint32_t memory[FRAME_MEMORY / 4];
static union {
    uint16_t rgb565[ELEMENTS];
#ifndef SMALL
    uint8_t rgb888[3 * ELEMENTS];
#endif
} pixels;

/* FNV-1a, 32 bits. */
static uint32_t hash(const uint8_t *bytes, size_t count) {
    uint32_t sum = 0x811c9dc5u;
    while (count-- > 0)
        sum = (sum ^ *bytes++) * 0x01000193u;
    return sum;
}

static void expect(RelumeStatus found, RelumeStatus expected, uint32_t *wrong) {
    if (found != expected) {
        say("wrong_status", (uint32_t)found);
        ++*wrong;
    }
}

static const RelumeFinish finish = {room_runs, ROOM_RUNS, ROOM_EXPOSURE};

static uint32_t show(uint32_t *wrong) {
    expect(relume_frame_rgb565(&frame, &finish, &relume_rgb565_bright, pixels.rgb565, ELEMENTS),
           RELUME_STATUS_OK, wrong);
    return hash((const uint8_t *)pixels.rgb565, sizeof pixels.rgb565);
}

/* What is refused, with nothing written. */
static void refusals(uint32_t *wrong) {
    static const RelumeAtlas zeros;
    RelumeInfo info;
    RelumeLight light;
    expect(relume_atlas_parse(NULL, ROOM_LENGTH, &atlas), RELUME_STATUS_NULL, wrong);
    expect(relume_atlas_parse(room, ROOM_LENGTH, NULL), RELUME_STATUS_NULL, wrong);
    expect(relume_atlas_parse(room, ROOM_LENGTH - 1, &atlas), RELUME_STATUS_DAMAGED, wrong);
    expect(relume_atlas_parse(room + 1, 100, &atlas), RELUME_STATUS_NOT_AN_ATLAS, wrong);
    expect(relume_atlas_parse(room, SIZE_MAX, &atlas), RELUME_STATUS_LENGTH, wrong);
    expect(relume_atlas_info(&zeros, &info), RELUME_STATUS_NOT_MADE, wrong);
    expect(relume_atlas_info(&atlas, NULL), RELUME_STATUS_NULL, wrong);
    expect(relume_atlas_light(&atlas, LIGHTS, &light), RELUME_STATUS_LIGHT, wrong);
    expect(relume_frame_full(&frame, first, LIGHTS - 1), RELUME_STATUS_LENGTH, wrong);
    expect(relume_frame_full(&frame, NULL, LIGHTS), RELUME_STATUS_NULL, wrong);
    expect(relume_frame_change(&frame, LIGHTS, first), RELUME_STATUS_LIGHT, wrong);
    expect(relume_frame_rgb565(&frame, &finish, NULL, pixels.rgb565, ELEMENTS), RELUME_STATUS_NULL, wrong);
    expect(relume_frame_rgb565(&frame, &finish, &relume_rgb565, pixels.rgb565, ELEMENTS),
           RELUME_STATUS_RANGE, wrong); /* brighter than that table's white */
    expect(relume_frame_rgb565(&frame, &finish, &relume_rgb565_bright, pixels.rgb565, ELEMENTS - 1),
           RELUME_STATUS_LENGTH, wrong);
    expect(relume_frame_rgb565(&frame, &finish, &relume_rgb565_bright,
                               (uint16_t *)((uintptr_t)pixels.rgb565 + 1), ELEMENTS),
           RELUME_STATUS_ALIGNMENT, wrong);
}

#ifndef SMALL
static uint32_t sums[3 * ELEMENTS];

static void irradiance(const RelumeRgb *full, uint32_t *wrong) {
    static uint32_t scratch[LIGHTS * RELUME_LIGHT_WORDS];
    float unit = 0;
    expect(relume_irradiance(&atlas, full, full, LIGHTS, scratch, LIGHTS * RELUME_LIGHT_WORDS, sums,
                             ELEMENTS, &unit),
           RELUME_STATUS_OK, wrong);
    say("irradiance", hash((const uint8_t *)sums, sizeof sums));
    say("unit", hash((const uint8_t *)&unit, sizeof unit));
}
#endif

int main(void) {
    uint32_t wrong = 0;
    expect(relume_atlas_parse(room, ROOM_LENGTH, &atlas), RELUME_STATUS_OK, &wrong);
    RelumeInfo info;
    expect(relume_atlas_info(&atlas, &info), RELUME_STATUS_OK, &wrong);
    if (info.elements != ELEMENTS || info.lights != LIGHTS || info.frame_memory > sizeof memory)
        return 2;

    static RelumeRgb full[LIGHTS];
    for (uint32_t light = 0; light < LIGHTS; ++light) {
        RelumeLight found;
        expect(relume_atlas_light(&atlas, light, &found), RELUME_STATUS_OK, &wrong);
        full[light] = found.emission;
    }
    expect(relume_frame_make(&atlas, full, LIGHTS, memory, info.frame_memory - 4, &frame), RELUME_STATUS_LENGTH,
           &wrong);
    expect(relume_frame_make(&atlas, full, LIGHTS, NULL, sizeof memory, &frame), RELUME_STATUS_NULL, &wrong);
    expect(relume_frame_make(&atlas, room_full, LIGHTS, memory, sizeof memory, &frame), RELUME_STATUS_OK, &wrong);

    uint32_t before = instructions();
    expect(relume_frame_full(&frame, second, LIGHTS), RELUME_STATUS_OK, &wrong);
    uint32_t sums_in = instructions() - before;
    say("count_sums", sums_in);
    say("full_565", show(&wrong));
    before = instructions();
    expect(relume_frame_full(&frame, second, LIGHTS), RELUME_STATUS_OK, &wrong);
    sums_in = instructions() - before;
    say("count_again", sums_in);
    say("again_565", show(&wrong));
    before = instructions();
    expect(relume_frame_rgb565(&frame, &finish, &relume_rgb565_bright, pixels.rgb565, ELEMENTS),
           RELUME_STATUS_OK, &wrong);
    say("count_show", instructions() - before);
#ifndef SMALL
    expect(relume_frame_rgb888(&frame, &finish, &relume_rgb888_bright, pixels.rgb888, ELEMENTS),
           RELUME_STATUS_OK, &wrong);
    say("full_888", hash(pixels.rgb888, sizeof pixels.rgb888));
    irradiance(full, &wrong);
#endif

    expect(relume_frame_full(&frame, first, LIGHTS), RELUME_STATUS_OK, &wrong);
    before = instructions();
    expect(relume_frame_change(&frame, CHANGED, &second[CHANGED]), RELUME_STATUS_OK, &wrong);
    say("count_change", instructions() - before);
    say("change_565", show(&wrong));
    expect(relume_frame_change(&frame, CHANGED, &first[CHANGED]), RELUME_STATUS_OK, &wrong);
    say("undone_565", show(&wrong));
    refusals(&wrong);
    say("stack", largest_stack());
    return wrong != 0;
}
