#include "renderer/scene/scene.h"
