#include "renderer/renderer.h" // caught: floor
#include "renderer/bench/run.h" // caught: floor
