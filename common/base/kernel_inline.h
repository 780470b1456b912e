// SPDX-License-Identifier: Apache-2.0
// For kernels only (see af_add_kernel). These functions are always inlined, so that no code for a
// wide vector width gets outside its kernel.
#pragma once

#define AF_KERNEL_INLINE static inline __attribute__((always_inline))
/// For member functions of a kernel's classes.
#define AF_KERNEL_MEMBER inline __attribute__((always_inline))
