#include "lib/brdf.glsl" // caught: floor
