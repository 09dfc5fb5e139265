#include <vulkan/vulkan.h>
#include "renderer/image/image.h" // caught: floor
