// film.h - gathered light while it is filtered, of gather.c and words.c.
// Floor 2, private to renderer/gather. Thread: any one at a time; rows are done by jobs.
#ifndef HG_RENDERER_GATHER_FILM_H
#define HG_RENDERER_GATHER_FILM_H

#include "renderer/gather/gather.h"
#include "renderer/math/vec.h"

#define ALIKE_DEPTH  0.05f // as a share of the depth
#define LEAST_ALBEDO 1e-4f // of a channel, that its light is divided by
#define LAMP_UNKNOWN 0.5f  // share of a lamp that no sample asked for

// Light of one kind: radiance; of what scatters also the environment's part of it had nothing been
// in its way, and the luminance of what did come. Then how much it is worth, variance of its
// luminance.
enum { RED, GREEN, BLUE, OPEN_RED, OPEN_GREEN, OPEN_BLUE, SKY, WORTH, VARIANCE, LIGHT_PLANES };
// Of surfaces. SLOPE_*: of depth, per px. CLOTH: 1 where sheen takes part in what scatters.
// NORMAL_*: means of unit normals, whose length ALONG tells how much samples agree.
enum { NORMAL_X, NORMAL_Y, NORMAL_Z, ALONG, DEPTH, SLOPE_X, SLOPE_Y, ROUGHNESS, CLOTH, GUIDES };
// SUNLIT: the share of directional lights that is seen, in place of a colour. LAMPLIT: that of the
// lamps of one number, one number after the other; only where there are such.
enum { SCATTERED, MIRRORED, SUNLIT, LAMPLIT, KINDS };

struct hg_gather {
    struct hg_gather_input in; // sums and halves while it is loaded; lamps: own, or NULL
    float *loaded, *more;      // memory of `from`, guides and lamps; of `to` and rows
    float *guides[GUIDES];
    float *from[KINDS][LIGHT_PLANES], *to[KINDS][LIGHT_PLANES];
    float *rows;           // [strips][LIGHT_PLANES + 1][width]
    uint32_t step, widest; // px between taps; beyond the latter only of what is noisy
    int kind;
    uint32_t lamp;    // number of those that are filtered
    float lamp_asked; // samples of a pixel that asked for it, where it reaches; 0: none
    float glass_px;   // by way of glass: px that light may come from, times alpha; else 0
    uint32_t *out;
};

static inline size_t hg_gather_pixels(const struct hg_gather *w)
{
    return (size_t)w->in.width * w->in.height;
}

// Memory of `to`, slopes, and variances of the surroundings. HG_E_NOMEM. Then the filter itself, by
// steps of 1, 2, 4 ... px, at most `most`.
enum hg_status hg_gather_prepare(
    struct hg_gather *gather, struct hg_jobs *jobs, struct hg_error *err) HG_MUST_CHECK;
void hg_gather_filter_kind(struct hg_gather *gather, struct hg_jobs *jobs, int kind, uint32_t most);

// The words of all pixels, out of `from`; uses `to`. By jobs for rows of a picture.
void hg_gather_part_row(void *gather, size_t y);      // first: the environment's share
void hg_gather_despeckle_row(void *gather, size_t y); // then what of specks stays
void hg_gather_pack_row(void *gather, size_t y);
void hg_gather_pack_lamp_row(void *gather, size_t y); // of the lamps that are filtered

#endif
