// SPDX-License-Identifier: Apache-2.0
#pragma once

/// Marks what the shared library exports. Nothing else of it can be called or replaced from
/// outside.
#define ATTENUATION_FIELDS_API __attribute__((visibility("default")))
