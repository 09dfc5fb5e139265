#include "renderer/renderer.h" // caught: apart
#include "server/broker/net.h" // caught: apart
