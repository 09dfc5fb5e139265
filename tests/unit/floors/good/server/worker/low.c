#include "server/worker/low.h"
static int one(void);
static const int table[] = {1};
struct low *low_make(int a,
    int b)
{
    return a + b + one() ? 0 : (struct low *)table;
}
static int one(void)
{
    return 1;
}
