#include "passes/shade.comp" // caught: pass
