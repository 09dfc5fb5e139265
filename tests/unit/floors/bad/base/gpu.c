#include <vulkan/vulkan.h> // caught: vulkan
