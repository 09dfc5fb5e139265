// caught: c++
#include "base/a.h"
