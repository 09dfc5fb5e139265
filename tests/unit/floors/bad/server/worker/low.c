#include "server/worker/low.h"
#include "server/worker/layers.h"
static void inside(void)
{
}
void low_run(void)
{
    inside();
}
struct low *low_make(int a, // caught: home
    int b)
{
    return 0;
}
