// flip.h - the LDR-FLIP error map of two pictures.
// Floor 1, private to renderer/image. Thread-safe.
// Source: Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astroem, Fairchild 2020,
// "FLIP: A Difference Evaluator for Alternating Images".
#ifndef HG_RENDERER_IMAGE_FLIP_H
#define HG_RENDERER_IMAGE_FLIP_H

#include "renderer/image/image.h"

// Writes one error 0..1 per pixel.
//   error              [height][width]   out
//   pixels_per_degree  of the observer; 67 is a 0.7 m wide 3840 px screen seen from 0.7 m
// Both images have the same size. HG_E_NOMEM.
enum hg_status hg_flip_map(const struct hg_image *reference, const struct hg_image *test,
    float pixels_per_degree, float *error) HG_MUST_CHECK;

#endif
