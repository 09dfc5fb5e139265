#include "renderer/renderer.h" // caught: floor
