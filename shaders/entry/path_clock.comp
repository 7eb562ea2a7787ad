// The whole path of a pixel, which shows how long it took by the device's clock (VK_KHR_shader_clock).
#extension GL_ARB_shader_clock : require
#define RAYGEN_CLOCK
#include "entry/path.comp"
