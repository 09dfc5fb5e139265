#include "renderer/geometry/lod.h" // caught: down
