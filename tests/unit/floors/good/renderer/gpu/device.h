#include <vulkan/vulkan.h>
#include "base/a.h"
#include "shaders/shared/types.h"
