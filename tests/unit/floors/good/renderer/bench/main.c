#include "renderer/bench/run.h"
#include "renderer/gpu/device.h"
#include "renderer/renderer.h"
