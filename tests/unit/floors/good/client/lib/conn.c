#include <netdb.h>
#include "helio/helio.h"
#include "client/include/helio/helio.h"

int helio_open(void)
{
    return 0;
}
