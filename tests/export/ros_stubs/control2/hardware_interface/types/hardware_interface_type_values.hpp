/* For the tests of holokin: stands in for the header of this name. */
#pragma once
#include "../../stand_in_control.hpp"
