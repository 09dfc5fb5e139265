#include <netdb.h>
#include "helio/helio.h"
#include "client/include/helio/helio.h"
