// ltc.h - linearly transformed cosines that stand for the specular lobe, fitted while building
// (make.c). Floor 2 (light). Pure; same result on every run.
//
// A lobe is the cosine of the upper hemisphere under the matrix
//   M = (X Y Z) (m11 0 m13; 0 m22 0; 0 0 1),   Y = (0 1 0), Z = (sine 0 cosine), X = Y x Z
// where z is the normal and the eye is at (-sin 0 cos). Source: Heitz, Dupuy, Hill and Neubelt
// 2016, "Real-Time Polygonal-Light Shading with Linearly Transformed Cosines".
#ifndef HG_RENDERER_LIGHT_LTC_LTC_H
#define HG_RENDERER_LIGHT_LTC_LTC_H

#include "shaders/shared/light.h"

struct hg_ltc {
    double m11, m22, m13, sine;
};

// All of the table (HG_LTC_* of shared/light.h): words of two half floats, m11 and m22, then m13
// and the sine over that of the eye, which are smooth where the eye is at the normal; the root of
// the cosine changes fastest, then perceptual roughness.
void hg_ltc_fill(uint32_t out[HG_LTC_WORDS]);

#endif
