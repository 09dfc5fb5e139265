#include "server/worker/top.h" // caught: layer
#include "server/worker/high.h" // caught: layer
void low_run(void);
