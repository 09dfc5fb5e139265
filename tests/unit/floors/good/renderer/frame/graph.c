#include "renderer/passes/shade.h"
