#include "renderer/bake/bake.h" // caught: floor
