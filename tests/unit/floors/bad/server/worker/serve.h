#include "renderer/renderer.h" // caught: vulkan
#include "server/broker/net.h" // caught: apart
#include "renderer/bench/run.h" // caught: apart
