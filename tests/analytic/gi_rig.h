// gi_rig.h - scenes and pictures of tests of global illumination.
#ifndef HG_TESTS_ANALYTIC_GI_RIG_H
#define HG_TESTS_ANALYTIC_GI_RIG_H

#include "tests/analytic/rig.h"

enum { GI_WIDTH = 64, GI_HEIGHT = 48 };

struct hg_material *gi_grey(struct rig *rig, float albedo, float emission);
// A box of six faces that is seen from inside, or from outside.
void gi_room(struct rig *rig, struct hg_material *m, const float box[2][3]);
void gi_solid(struct rig *rig, struct hg_material *m, const float box[2][3]);
// An environment that is the same everywhere.
void gi_sky(struct rig *rig, float radiance);

struct gi_shot {
    float eye[3], target[3];
    enum hg_view_gi gi;
    enum hg_render_mode mode;
    uint32_t samples;
};

// Publishes the scene if it has been edited.
struct hg_view *gi_open_view(struct rig *rig, const struct gi_shot *shot);
// A settled view. As long as it is there, other views of the scene as it is have its field of
// probes.
struct hg_view *gi_keep_field(struct rig *rig, const struct gi_shot *shot);
// Steps of so many samples until the picture is settled.
void gi_settle(struct hg_view *view, uint32_t samples);
struct hg_refbuf *gi_read_floats(struct hg_view *view);
// Equal bytes; frees both.
void gi_assert_same(struct hg_refbuf *a, struct hg_refbuf *b);
// The settled picture.
struct hg_refbuf *gi_take(struct rig *rig, const struct gi_shot *shot);
// By probes alone, and gathered by rays from each pixel; the field of probes is made once.
void gi_take_both(struct rig *rig, const struct gi_shot *shot, struct hg_refbuf *out[2]);
extern const char *const gi_ways[2]; // the names of both

// Mean of green over a rectangle given in eighths of the picture.
double gi_mean(const struct hg_refbuf *pixels, const int cells[4]);
// The same of the linear light behind sRGB bytes.
double gi_mean_of_bytes(const struct hg_refbuf *pixels, const int cells[4]);
extern const int gi_all[4]; // of the picture
// Squares of a quarter of the picture's side, from row `first` on (in eighths). limits: of what a
// square is off by, and all of them in the mean.
void gi_compare(const char *name, const struct hg_refbuf *got, const struct hg_refbuf *path,
    int first, double limits[2]);

#endif
