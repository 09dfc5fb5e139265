#include "renderer/gpu/device.h"
