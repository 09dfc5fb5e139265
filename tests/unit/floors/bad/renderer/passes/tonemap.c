#include "renderer/passes/shade.h" // caught: pass
