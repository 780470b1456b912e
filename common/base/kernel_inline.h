// SPDX-License-Identifier: Apache-2.0
// For kernels only (see af_add_kernel): functions that are never called, so that no code of a wide
// vector width gets outside its kernel.
#pragma once

#define AF_KERNEL_INLINE static inline __attribute__((always_inline))
/// For members of classes of kernels.
#define AF_KERNEL_MEMBER inline __attribute__((always_inline))
