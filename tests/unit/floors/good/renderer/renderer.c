#include "renderer/renderer.h"
#include "renderer/gpu/device.h"
