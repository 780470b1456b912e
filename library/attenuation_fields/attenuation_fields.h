// SPDX-License-Identifier: Apache-2.0
// All of the library. docs/library.md is its guide.
#pragma once

#include "attenuation_fields/beam.h"
#include "attenuation_fields/ct.h"
#include "attenuation_fields/errors.h"
#include "attenuation_fields/evaluation.h"
#include "attenuation_fields/geometry.h"
#include "attenuation_fields/registration.h"
#include "attenuation_fields/renderer.h"
#include "attenuation_fields/stop_condition.h"
#include "attenuation_fields/version.h"
