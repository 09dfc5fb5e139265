#include "renderer/gpu/device.h" // caught: floor
