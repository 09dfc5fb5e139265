#include "renderer/renderer.h" // caught: vulkan
#include "server/broker/net.h" // caught: apart
