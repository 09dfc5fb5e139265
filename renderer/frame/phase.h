// phase.h - phase of a view's real-time picture, and its shortfall.
// Floor 4. Plain values; renderer.h hands them to callers.
//
// "asked": another scene, camera or settings than the picture was made of. "in motion": one sample
// of it in a step that is not final. "short": a bit of enum hg_view_shortfall is set.
//
//   state         event                                              next
//   any           asked; not displayed (final) and pages are missing EXACT, blank
//   any           asked, in motion, and only RGBA8 is read           DIRECT
//   any           asked, the sample is short                         PROVISIONAL
//   any           asked, the sample is whole                         ACCUMULATING
//   any           a step fails, the size changes                     EMPTY
//   DIRECT        a step; exposure or light is not ready (a few)     DIRECT, of the whole size
//   DIRECT        a step otherwise                                   as asked, from sample 0
//   PROVISIONAL   a step: the budgets of pages or geometry are too   EXACT; what was shown is the
//                 small, or nothing that is missing is on its way    fallback
//   PROVISIONAL   a step otherwise                                   as asked, from sample 0
//   ACCUMULATING  the first sample is whole, and pages may be        EXACT, from sample 1
//                 missing for others
//   ACCUMULATING  a step                                             ACCUMULATING, more samples
//   EXACT         a step: pages, shadow maps, samples of an area     EXACT
//   EXACT         lists of blended surfaces lacked memory            as asked, from sample 0
//   EXACT, blank  a client looks before the first sample             as asked, from sample 0
//
// ACCUMULATING and EXACT are settled with the samples that are asked for and no shortfall.
#ifndef HG_RENDERER_FRAME_PHASE_H
#define HG_RENDERER_FRAME_PHASE_H

enum hg_view_phase {
    HG_VIEW_EMPTY,        // no valid samples; the previous picture may still be displayed
    HG_VIEW_DIRECT,       // one sample, straight to RGBA8 pixels
    HG_VIEW_PROVISIONAL,  // samples with a shortfall: they will be discarded
    HG_VIEW_ACCUMULATING, // samples of the whole picture
    HG_VIEW_EXACT,        // samples pixel by pixel, in areas if need be (tiled_accumulation.h)
};

// Bits: how the newest samples fall short of the requested picture.
enum hg_view_shortfall {
    HG_SHORT_OF_SHADOWS = 1 << 0,  // finer cascades were left out
    HG_SHORT_OF_LAYERS = 1 << 1,   // lists of blended surfaces lacked memory
    HG_SHORT_OF_TEXELS = 1 << 2,   // pages were missing, or mips left out for the budget
    HG_SHORT_OF_DETAIL = 1 << 3,   // the error of geometry was raised to keep to the frame time
    HG_SHORT_OF_GEOMETRY = 1 << 4, // the geometry budget did not hold what was chosen
    HG_SHORT_OF_CLUSTERS = 1 << 5, // clusters that were chosen have not been read yet
};

#endif
