#include "server/worker/serve.h" // caught: floor
#include "renderer/bench/run.h" // caught: floor
