// pass_io.h - the images that each pass reads and writes through descriptor set 1 (io.h).
// Floor 0, shared by C and GLSL. Attachments are not listed here: shaders do not name them.
#ifndef HG_SHADERS_SHARED_PASS_IO_H
#define HG_SHADERS_SHARED_PASS_IO_H

#include "shared/io.h"

// shade*.frag; front: of layers the opaque scene, else the layers in front of it (lib/shade.glsl);
// gathered: gathered light or probe light, shared/gi.h, of layers what rays brought to glass, shared/glass.h; mirrored: shared/mirror.h;
// of layers light by way of glass: radiance of transmissive surfaces, premultiplied by their share of the pixel.
#define HG_SHADE_IO(X)                                                                             \
    X(0, NEAREST_U2D, visibility)                                                                  \
    X(1, NEAREST_2D, front)                                                                        \
    X(2, NEAREST_U2D, gathered)                                                                    \
    X(3, NEAREST_2D, mirrored)
// visibility_alpha*.frag, for the nearest layer.
#define HG_ALPHA_MASK_IO(X) X(0, NEAREST_2D, opaque_depth)
// unlit_tiles_cells.comp, checkerboard.frag
#define HG_DEPTH_IO(X) X(0, NEAREST_2D, depth)
#define HG_PROBE_LIGHT_IO(X)                                                                       \
    X(0, NEAREST_U2D, visibility)                                                                  \
    X(1, NEAREST_2D, depth)
#define HG_PICK_IO(X)  X(0, NEAREST_U2D, visibility)
#define HG_POSED_MOTION_IO(X) X(0, NEAREST_U2D, visibility)
#define HG_DEBUG_IO(X)                                                                             \
    X(0, NEAREST_U2D, visibility)                                                                  \
    X(1, NEAREST_2D, counts)
#define HG_RESOLVE_IO(X)                                                                           \
    X(0, NEAREST_2D, accumulated)                                                                  \
    X(1, NEAREST_2D, fallback)

// Tests of the device room and of the frame graph.
#define HG_TEST_MIP_IO(X)                                                                          \
    X(0, IMAGE_2D_R32F, finer)                                                                     \
    X(1, IMAGE_2D_R32F, coarser)
#define HG_TEST_VOLUME_IO(X)                                                                       \
    X(0, LINEAR_3D, volume)                                                                        \
    X(1, IMAGE_3D_R32F, volume_out)
#define HG_TEST_BLEND_IO(X)                                                                        \
    X(0, NEAREST_2D, first)                                                                        \
    X(1, NEAREST_2D, second)

#endif
