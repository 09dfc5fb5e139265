#include "a.h" // caught: root
#include "base/../base/a.h" // caught: root
#include "base/missing.h" // caught: root
