#include "server/worker/lost.h" // caught: layer
