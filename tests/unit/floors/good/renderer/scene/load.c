#include "renderer/scene/formats/formats.h"
