#include "server/worker/layers.h"
struct low *low_make(int a, int b);
