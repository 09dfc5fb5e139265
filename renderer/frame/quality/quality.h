// quality.h - quality governor: chooses scale or checkerboard, rays and LOD error of pictures in
// motion for a target frame time.
// Floor 4. Pure; one object per view, zeroed = no frame seen yet.
//
// A model of where the time goes (each part at full quality, from measured times) predicts what
// each choice would take; of those that hold the target the one that loses least is taken. Two
// frames over the target in a row make the choice cheaper at once; a better one needs room below
// the target, and time: twice as long each time that the last one did not hold, so a wrong model
// cannot make the picture swing.
#ifndef HG_RENDERER_FRAME_QUALITY_QUALITY_H
#define HG_RENDERER_FRAME_QUALITY_QUALITY_H

#include <stdbool.h>
#include <stdint.h>

#define HG_QUALITY_MOST 32.0f // times the view's own error

struct hg_quality_choice {
    float scale;       // of the sides of the drawn picture, 0.5 .. 1
    float rays;        // share of rays, of probes and reflections, 0.25 .. 1
    float factor;      // on the view's projected error, 1 .. HG_QUALITY_MOST
    bool checkerboard; // every second pixel is shaded; at the whole size
};

// What there is to choose. Rays always are.
struct hg_quality_levers {
    bool scale, checkerboard;
    bool error; // geometry has levels of detail: without any an error changes nothing
};

// Which parts of a frame's time follow from which choice. HG_QUALITY_REST: from none.
enum hg_quality_part {
    HG_QUALITY_REST,
    HG_QUALITY_PIXELS,  // of all of them
    HG_QUALITY_SHADING, // of those that are shaded
    HG_QUALITY_RAYS,
    HG_QUALITY_TRIANGLES
};
#define HG_QUALITY_PARTS 5

struct hg_quality {
    float full_ms[HG_QUALITY_PARTS]; // of a frame at full quality, as estimated
    struct hg_quality_choice now;    // zeroed = full quality
    uint32_t frames, over;           // seen; over the target, in a row
    uint32_t since, wait;            // frames since the last change, and until the next better one
    bool on_trial;                   // the last change was to a better one
};

// Of the next moving frame; target_ms 0: full quality.
struct hg_quality_choice hg_quality_choose(const struct hg_quality *quality, float target_ms);
// A moving frame that was drawn with hg_quality_choose took part_ms[HG_QUALITY_PARTS]. levers: of
// the next one.
void hg_quality_note(struct hg_quality *quality, const float *part_ms, float target_ms,
    const struct hg_quality_levers *levers);

#endif
