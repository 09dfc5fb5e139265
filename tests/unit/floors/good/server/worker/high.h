#include "server/worker/low.h"
