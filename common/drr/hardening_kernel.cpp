// SPDX-License-Identifier: Apache-2.0
#include "drr/hardening_kernel.h"

#include "base/processor.h"

namespace af::AF_KERNEL_NAMESPACE {

namespace {

using native::Floats;
using native::Ints;
using native::kLanes;
using native::load;
using native::splat;
using native::store;

constexpr float kLog2E = 1.44269504f;

/// log2(y) for y >= 1, to a few roundings and the 5e-8 of the truncated series: y = 2^e m with m
/// around 1, and log(m) = 2 atanh((m - 1) / (m + 1)).
AF_KERNEL_INLINE Floats log2_of(Floats y) {
  constexpr int32_t kRootOfHalf = 0x3f3504f3;
  const Ints bits = reinterpret_cast<Ints>(y);
  const Ints exponent = (bits - kRootOfHalf) >> 23;
  const Floats m = reinterpret_cast<Floats>(bits - (exponent << 23));
  const Floats s = (m - 1.0f) / (m + 1.0f);
  const Floats q = s * s;
  const Floats series = (2.0f * kLog2E + q * (kLog2E * (2.0f / 3.0f))) +
                        (q * q) * (kLog2E * 0.4f + q * (kLog2E * (2.0f / 7.0f)));
  return native::to_float(exponent) + s * series;
}

/// What the ray holds, limited to possible values and to the reach of the polynomial.
struct Materials {
  Floats water, bone;
  Floats water_beyond, bone_beyond;  ///< what exceeds the reaches
};

AF_KERNEL_INLINE Materials materials_of(const HardeningPolynomial& polynomial,
                                        Floats all,
                                        Floats bone) {
  const Floats ray = native::maximum(all, splat(0.0f));
  const Floats ray_bone = native::minimum(native::maximum(bone, splat(0.0f)), ray);
  const Floats ray_water = ray - ray_bone;
  Materials found{};
  found.water = native::minimum(ray_water, splat(polynomial.reach[0]));
  found.bone = native::minimum(ray_bone, splat(polynomial.reach[1]));
  found.water_beyond = ray_water - found.water;
  found.bone_beyond = ray_bone - found.bone;
  return found;
}

/// Powers that polynomials of z take. Chains are short, because a processor waits for each link.
struct Powers {
  Floats z, z2, z4;
};

/// Two to four terms.
template <int kCount>
AF_KERNEL_INLINE Floats short_sum(const float* terms, const Powers& z_powers) {
  const Floats low = terms[0] + terms[1] * z_powers.z;
  if (kCount == 2) return low;
  if (kCount == 3) return low + terms[2] * z_powers.z2;
  return low + (terms[2] + terms[3] * z_powers.z) * z_powers.z2;
}

/// sum_i terms[i] z^i of at most eight terms.
template <int kCount>
AF_KERNEL_INLINE Floats sum_of(const float* terms, const Powers& z_powers) {
  if constexpr (kCount == 1)
    return splat(terms[0]);
  else if constexpr (kCount <= 4)
    return short_sum<kCount>(terms, z_powers);
  else if constexpr (kCount == 5)
    return short_sum<4>(terms, z_powers) + terms[4] * z_powers.z4;
  else
    return short_sum<4>(terms, z_powers) + short_sum<kCount - 4>(terms + 4, z_powers) * z_powers.z4;
}

/// sum_i c_ij z^i for one power of a, and its derivative with respect to z.
struct Row {
  Floats value, slope;
};

template <int kPower, bool kWithSlopes>
AF_KERNEL_INLINE Row row_of(const HardeningPolynomial& polynomial, const Powers& powers) {
  constexpr int kCount = HardeningPolynomial::kTerms[kPower];
  const float* const terms = polynomial.terms + HardeningPolynomial::kFirst[kPower];
  Row row{sum_of<kCount>(terms, powers), splat(0.0f)};
  if (kWithSlopes) {
    float slopes[HardeningPolynomial::kTerms[0]];
    for (int i = 1; i < kCount; ++i) slopes[i - 1] = static_cast<float>(i) * terms[i];
    row.slope = sum_of<kCount - 1>(slopes, powers);
  }
  return row;
}

/// U and its derivatives with respect to water and bone.
struct Hardened {
  Floats value, by_water, by_bone;
};

/// A ray's coordinates on the polynomial.
struct Place {
  Floats y;  ///< 2^(x / log_scale)
  Floats a;
  Floats straight;
};

AF_KERNEL_INLINE Floats product(const float (&factors)[2], const Materials& ray) {
  return factors[0] * ray.water + factors[1] * ray.bone;
}

AF_KERNEL_INLINE Place place_of(const HardeningPolynomial& polynomial, const Materials& ray) {
  return {1.0f + product(polynomial.hard, ray),
          product(polynomial.tilt, ray),
          product(polynomial.straight, ray)};
}

AF_KERNEL_INLINE Powers powers_of(Floats x) {
  const Floats z = 2.0f * x - 1.0f;
  const Floats z2 = z * z;
  return {z, z2, z2 * z2};
}

struct Rows {
  Row r0, r1, r2, r3;
};

template <bool kWithSlopes>
AF_KERNEL_INLINE Rows rows_of(const HardeningPolynomial& polynomial, Floats x) {
  const Powers powers = powers_of(x);
  return {row_of<0, kWithSlopes>(polynomial, powers),
          row_of<1, kWithSlopes>(polynomial, powers),
          row_of<2, kWithSlopes>(polynomial, powers),
          row_of<3, kWithSlopes>(polynomial, powers)};
}

AF_KERNEL_INLINE Floats sum_of_rows(const Rows& rows, Floats a) {
  return rows.r0.value + a * (rows.r1.value + a * (rows.r2.value + a * rows.r3.value));
}

AF_KERNEL_INLINE Hardened within_reach(const HardeningPolynomial& polynomial,
                                       const Materials& ray) {
  const Place place = place_of(polynomial, ray);
  const Floats x = polynomial.log_scale * log2_of(place.y);
  const Rows rows = rows_of<true>(polynomial, x);
  const Floats a = place.a;
  const Floats sum = sum_of_rows(rows, a);
  const Floats by_z = rows.r0.slope + a * (rows.r1.slope + a * (rows.r2.slope + a * rows.r3.slope));
  const Floats by_a = x * (rows.r1.value + a * (2.0f * rows.r2.value + 3.0f * a * rows.r3.value));
  const Floats by_y = (sum + 2.0f * x * by_z) * (polynomial.log_scale * kLog2E) / place.y;
  return {place.straight + x * sum,
          polynomial.straight[0] + by_y * polynomial.hard[0] + by_a * polynomial.tilt[0],
          polynomial.straight[1] + by_y * polynomial.hard[1] + by_a * polynomial.tilt[1]};
}

AF_KERNEL_INLINE Hardened gone_on(Hardened at_reach, const Materials& ray) {
  at_reach.value += at_reach.by_water * ray.water_beyond + at_reach.by_bone * ray.bone_beyond;
  return at_reach;
}

/// U, and its derivatives with respect to all and, where all stays, bone.
struct WithSlopes {
  Floats value, by_all, by_bone;
};

AF_KERNEL_INLINE WithSlopes hardened_with_slopes(const HardeningPolynomial& polynomial,
                                                 Floats all,
                                                 Floats bone) {
  const Floats zero = splat(0.0f);
  const Floats slope_of_air = splat(polynomial.slope_of_air);
  const Ints is_body = all > 0.0f;
  if (!native::any(is_body)) return {polynomial.slope_of_air * all, slope_of_air, zero};
  const Materials ray = materials_of(polynomial, all, bone);
  const Hardened found = gone_on(within_reach(polynomial, ray), ray);
  const Ints is_all_bone = bone > all;
  const Floats by_all = is_all_bone ? found.by_bone : found.by_water;
  const Floats by_bone = (is_all_bone | (bone < 0.0f)) ? zero : found.by_bone - found.by_water;
  return {is_body ? found.value : polynomial.slope_of_air * all,
          is_body ? by_all : slope_of_air,
          is_body ? by_bone : zero};
}

/// Up to kLanes values; the lanes beyond are 0.
AF_KERNEL_INLINE Floats load_some(const float* from, int64_t count) {
  if (count >= kLanes) return load(from);
  float lanes[kLanes] = {};
  for (int64_t i = 0; i < count; ++i) lanes[i] = from[i];
  return load(lanes);
}

AF_KERNEL_INLINE void store_some(float* to, int64_t count, Floats value) {
  if (count >= kLanes) {
    store(to, value);
    return;
  }
  float lanes[kLanes];
  store(lanes, value);
  for (int64_t i = 0; i < count; ++i) to[i] = lanes[i];
}

/// Number of pixels that go through one step before the next begins. Each step is short, so that a
/// processor works on several of its vectors at a time.
constexpr int32_t kBlock = 256;

/// `count`: a multiple of kLanes, at most kBlock.
AF_KERNEL_INLINE void harden_block(const HardeningPolynomial& polynomial,
                                   int32_t count,
                                   float* all,
                                   const float* bone) {
  float y[kBlock];
  float a[kBlock];
  float straight[kBlock];
  Ints is_body = splat(0);
  Ints is_beyond = splat(0);
  for (int32_t i = 0; i < count; i += kLanes) {
    const Floats ray_all = load(all + i);
    const Materials ray = materials_of(polynomial, ray_all, load(bone + i));
    const Place place = place_of(polynomial, ray);
    is_body |= ray_all > 0.0f;
    is_beyond |= (ray.water_beyond > 0.0f) | (ray.bone_beyond > 0.0f);
    store(y + i, place.y);
    store(a + i, place.a);
    store(straight + i, place.straight);
  }
  if (native::any(is_beyond)) {
    for (int32_t i = 0; i < count; i += kLanes) {
      const Floats ray_all = load(all + i);
      const Floats ray_bone = load(bone + i);
      store(all + i, hardened_with_slopes(polynomial, ray_all, ray_bone).value);
    }
    return;
  }
  if (!native::any(is_body)) {
    for (int32_t i = 0; i < count; i += kLanes)
      store(all + i, polynomial.slope_of_air * load(all + i));
    return;
  }
  for (int32_t i = 0; i < count; i += kLanes)
    store(y + i, polynomial.log_scale * log2_of(load(y + i)));
  for (int32_t i = 0; i < count; i += kLanes) {
    const Floats ray_all = load(all + i);
    const Floats x = load(y + i);
    const Floats body =
        load(straight + i) + x * sum_of_rows(rows_of<false>(polynomial, x), load(a + i));
    store(all + i, ray_all > 0.0f ? body : polynomial.slope_of_air * ray_all);
  }
}

/// The same for any count below kLanes.
AF_KERNEL_INLINE void harden_rest(const HardeningPolynomial& polynomial,
                                  int32_t count,
                                  float* all,
                                  const float* bone) {
  float padded[kLanes];
  float padded_bone[kLanes];
  store(padded, load_some(all, count));
  store(padded_bone, load_some(bone, count));
  harden_block(polynomial, kLanes, padded, padded_bone);
  store_some(all, count, load(padded));
}

}  // namespace

void harden_pixels(const HardeningPolynomial& given, int64_t count, float* all, const float* bone) {
  // A copy, so that the compiler knows that no store changes it.
  const HardeningPolynomial polynomial = given;
  int64_t i = 0;
  while (count - i >= kLanes) {
    const int64_t left = (count - i) / kLanes * kLanes;
    const auto now = static_cast<int32_t>(left < kBlock ? left : kBlock);
    harden_block(polynomial, now, all + i, bone + i);
    i += now;
  }
  if (i < count) harden_rest(polynomial, static_cast<int32_t>(count - i), all + i, bone + i);
}

void harden_with_slopes(const HardeningPolynomial& given,
                        int64_t count,
                        float* all,
                        const float* bone,
                        int32_t planes,
                        float* all_slopes,
                        const float* bone_slopes) {
  const HardeningPolynomial polynomial = given;
  for (int64_t i = 0; i < count; i += kLanes) {
    const int64_t left = count - i;
    const WithSlopes found =
        hardened_with_slopes(polynomial, load_some(all + i, left), load_some(bone + i, left));
    store_some(all + i, left, found.value);
    for (int32_t plane = 0; plane < planes; ++plane) {
      const int64_t at = plane * count + i;
      store_some(all_slopes + at,
                 left,
                 found.by_all * load_some(all_slopes + at, left) +
                     found.by_bone * load_some(bone_slopes + at, left));
    }
  }
}

}  // namespace af::AF_KERNEL_NAMESPACE
