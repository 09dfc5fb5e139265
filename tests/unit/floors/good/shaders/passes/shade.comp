#include "shared/types.h"
#include "lib/brdf.glsl"
