#include "server/worker/serve.h" // caught: floor
