/* The C interface of Relume's relighting.
 *
 * Nothing is allocated: atlases are borrowed, and all memory is the caller's. Every function returns a status; on any
 * but RELUME_STATUS_OK nothing was written that counts. Rules:
 *
 * - a pointer is null, which is refused, or valid for as many values as its length says, and aligned for its type;
 *   what is written to overlaps nothing else;
 * - the bytes of an atlas stay where they are, unchanged, as long as a RelumeAtlas or RelumeFrame made from them is
 *   used; the same holds for the memory of a frame, which nobody else touches;
 * - a RelumeAtlas or RelumeFrame is all zeros, which is refused, or was filled by this library. Atlases may be copied,
 *   frames not; a frame is used by one thread at a time.
 *
 * Build: cargo build --profile device -p relume-ffi --target thumbv7em-none-eabihf (or any other). A bare-metal
 * library calls void relume_panic(void) where it could not go on; nothing that is optimised does, so that a
 * program links without one. */

#ifndef RELUME_H
#define RELUME_H

/* Made from solver/ffi/src by tests/c_library.rs: change those, then run it with RELUME_BLESS=1. */

#include <stddef.h>
#include <stdint.h>

// Words of memory for each light of `relume_irradiance`.
#define RELUME_LIGHT_WORDS 24

// How a call ended.
typedef enum RelumeStatus {
  // All is well.
  RELUME_STATUS_OK = 0,
  // A pointer is null.
  RELUME_STATUS_NULL = 1,
  // A pointer is not aligned for its type.
  RELUME_STATUS_ALIGNMENT = 2,
  // A length does not fit the atlas.
  RELUME_STATUS_LENGTH = 3,
  // An atlas or a frame was not made by this library.
  RELUME_STATUS_NOT_MADE = 4,
  // The bytes are not an atlas.
  RELUME_STATUS_NOT_AN_ATLAS = 5,
  // The atlas is of a version that is not known here.
  RELUME_STATUS_VERSION = 6,
  // The atlas is cut off, has bytes too many, or was damaged.
  RELUME_STATUS_DAMAGED = 7,
  // The atlas holds something illegal.
  RELUME_STATUS_ILLEGAL = 8,
  // There is no such light.
  RELUME_STATUS_LIGHT = 9,
  // A weight is negative or not finite.
  RELUME_STATUS_WEIGHT = 10,
  // The mix is too bright, or the exposure is not positive or too large.
  RELUME_STATUS_RANGE = 11,
  // The atlas is in codes that this function does not read.
  RELUME_STATUS_CODE = 12,
} RelumeStatus;

// What the contributions of an atlas measure.
typedef enum RelumeQuantity {
  // Irradiance in W/m2: reflectances are applied after relighting.
  RELUME_QUANTITY_IRRADIANCE = 0,
  // Radiosity in W/m2: reflectances are multiplied in.
  RELUME_QUANTITY_RADIOSITY = 1,
  // Radiance of a picture: the elements are its pixels.
  RELUME_QUANTITY_RADIANCE = 2,
} RelumeQuantity;

// Linear steps to RGB565.
typedef struct RelumeRgb565Table RelumeRgb565Table;

// Linear steps to three bytes of sRGB.
typedef struct RelumeRgb888Table RelumeRgb888Table;

// A parsed atlas, which borrows its bytes. What is in it is the library's.
typedef struct RelumeAtlas {
  uint32_t made;
  uint64_t words[30];
} RelumeAtlas;

// What an atlas holds.
typedef struct RelumeInfo {
  // Elements.
  uint32_t elements;
  // Lights.
  uint32_t lights;
  // What the contributions measure.
  enum RelumeQuantity quantity;
  // Width and height of the picture whose pixels, row by row, are the elements; 0 for an atlas of no picture.
  uint32_t width;
  // See `width`.
  uint32_t height;
  // Bytes of memory of a frame, a multiple of 4; 0 where they cannot be counted.
  size_t frame_memory;
} RelumeInfo;

// A linear RGB triple.
typedef struct RelumeRgb {
  // Red.
  float r;
  // Green.
  float g;
  // Blue.
  float b;
} RelumeRgb;

// A light of an atlas.
typedef struct RelumeLight {
  // Its name in UTF-8, borrowed from the atlas, without a zero at its end.
  const uint8_t *name;
  // Bytes of the name.
  size_t name_length;
  // Nominal weight.
  struct RelumeRgb emission;
  // Name of the code that its contributions are written in, as `lum8`, in UTF-8, without a zero at its end.
  const uint8_t *code;
  // Bytes of the code's name.
  size_t code_length;
} RelumeLight;

// An atlas under a mix: its sums, kept from frame to frame. What is in it is the library's.
typedef struct RelumeFrame {
  uint32_t made;
  uint64_t words[48];
} RelumeFrame;

// A light's share of its full weight, in 2^-16, channel by channel.
typedef struct RelumeLevels {
  // Red.
  uint16_t r;
  // Green.
  uint16_t g;
  // Blue.
  uint16_t b;
} RelumeLevels;

// Elements that follow each other and reflect alike.
typedef struct RelumeRun {
  // How many.
  uint32_t elements;
  // Their reflectance in red, green and blue, in 2^-16; 65535 for an atlas of radiosity or radiance.
  uint16_t reflectance[3];
} RelumeRun;

// How sums become pixels.
typedef struct RelumeFinish {
  // Reflectances of all elements, in their order.
  const struct RelumeRun *runs;
  // How many runs there are.
  size_t run_count;
  // Factor on radiance, 1 being white.
  float exposure;
} RelumeFinish;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The table for frames in which nothing is brighter than white.
extern const struct RelumeRgb565Table relume_rgb565;

// The table for frames in which elements may be twice as bright as white, with half as many steps below it.
extern const struct RelumeRgb565Table relume_rgb565_bright;

// As [`relume_rgb565`].
extern const struct RelumeRgb888Table relume_rgb888;

// As [`relume_rgb565_bright`].
extern const struct RelumeRgb888Table relume_rgb888_bright;

// Parses the bytes of an atlas, checksum included, without copying them; a mesh in it is left unread.
enum RelumeStatus relume_atlas_parse(const uint8_t *bytes,
                                     size_t length,
                                     struct RelumeAtlas *atlas);

// Tells what an atlas holds.
enum RelumeStatus relume_atlas_info(const struct RelumeAtlas *atlas, struct RelumeInfo *info);

// Tells what a light is.
enum RelumeStatus relume_atlas_light(const struct RelumeAtlas *atlas,
                                     uint32_t light,
                                     struct RelumeLight *found);

// Makes a frame, all lights off. `full` has the largest weight that each light will have, and `memory` as many bytes
// as `RelumeInfo::frame_memory` says; the frame keeps it.
enum RelumeStatus relume_frame_make(const struct RelumeAtlas *atlas,
                                    const struct RelumeRgb *full,
                                    size_t lights,
                                    uint32_t *memory,
                                    size_t bytes,
                                    struct RelumeFrame *frame);

// Sets the levels of all lights, and adds them up. For an atlas that is neither all in `lum8` nor all in codes of three bytes,
// the table of a light is kept as long as its levels stay.
enum RelumeStatus relume_frame_full(struct RelumeFrame *frame,
                                    const struct RelumeLevels *levels,
                                    size_t lights);

// Sets the levels of one light; the bits are those of `relume_frame_full`. An atlas whose tables are kept is added up anew.
enum RelumeStatus relume_frame_change(struct RelumeFrame *frame,
                                      uint32_t light,
                                      const struct RelumeLevels *levels);

// Shows a frame in RGB565, a pixel for every element; `table` is one of the library's.
enum RelumeStatus relume_frame_rgb565(const struct RelumeFrame *frame,
                                      const struct RelumeFinish *finish,
                                      const struct RelumeRgb565Table *table,
                                      uint16_t *pixels,
                                      size_t count);

// Shows a frame in sRGB, three bytes for every element; `table` is one of the library's, `count` the number of elements.
enum RelumeStatus relume_frame_rgb888(const struct RelumeFrame *frame,
                                      const struct RelumeFinish *finish,
                                      const struct RelumeRgb888Table *table,
                                      uint8_t *pixels,
                                      size_t count);

// Irradiance of every element (or what else the atlas holds) under a mix: `sums` gets red, green and blue of each of the
// `elements`, and `unit` what one unit of them is worth, a power of two. The unit fits `brightest`, which no weight of `mix` exceeds;
// `memory` is scratch of `RELUME_LIGHT_WORDS` for each light. Weights are set in floats, all else is integers.
enum RelumeStatus relume_irradiance(const struct RelumeAtlas *atlas,
                                    const struct RelumeRgb *brightest,
                                    const struct RelumeRgb *mix,
                                    size_t lights,
                                    uint32_t *memory,
                                    size_t words,
                                    uint32_t *sums,
                                    size_t elements,
                                    float *unit);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* RELUME_H */
