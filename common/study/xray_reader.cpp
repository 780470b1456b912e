// SPDX-License-Identifier: Apache-2.0
#include "study/xray_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "images/image_header.h"
#include "study/xray_undistortion.h"
#include "xray/air_level.h"
#include "xray/dicom_xray.h"
#include "xray/image_file.h"
#include "xray/quantile.h"
#include "xray/xray_borders.h"

namespace af {

namespace {

/// Share of pixels that are no brighter than what counts as the open beam.
constexpr double kOpenBeamShare = 0.999;
/// Share of the camera's pixel spacing. Decimal strings are rounded, and detectors are measured to
/// this.
constexpr double kMaxSpacingShare = 0.01;
/// Share of the region of interest that an automatic mask may hide. More is a mistake of the mask.
constexpr double kMostHidden = 0.5;
/// Share of a flat field's pixels that may be no brighter than the dark image.
constexpr double kMostDeadPixels = 0.25;

struct LoadedImage {
  Image2d image;
  std::optional<Eigen::Vector2d> spacing_mm;  ///< for formats other than DICOM
  std::optional<DicomXray> dicom;             ///< without its image and data
  Image2d data;                               ///< 0 where a pixel is padding; empty without padding
  std::string note;                           ///< for formats other than DICOM
};

LoadedImage load(const std::filesystem::path& path, std::optional<int> frame) {
  LoadedImage loaded;
  if (sniff_image_format(path) == ImageFormat::Dicom) {
    loaded.dicom = read_dicom_xray(path, frame);
    loaded.image = std::move(loaded.dicom->image);
    loaded.data = std::move(loaded.dicom->data);
    return loaded;
  }
  ImageWithSpacing read = read_image_with_spacing(path);
  if (frame)
    throw InputError("xray_frame",
                     std::to_string(*frame),
                     "is for DICOM files of several frames",
                     path.string());
  return {std::move(read.image), read.spacing_mm, std::nullopt, Image2d(), read.note};
}

void check_size(const Image2d& image, const std::string& file, const CameraGeometry& camera) {
  if (image.width != camera.size_px.x() || image.height != camera.size_px.y())
    throw InputError("size",
                     std::to_string(image.width) + " x " + std::to_string(image.height) + " px",
                     "must be that of camera '" + camera.name +
                         "': " + std::to_string(camera.size_px.x()) + " x " +
                         std::to_string(camera.size_px.y()) + " px",
                     file);
}

std::string spacing_text(const Eigen::Vector2d& spacing_mm) {
  return number_text(spacing_mm.x()) + " x " + number_text(spacing_mm.y()) + " mm";
}

bool is_spacing_of(const CameraGeometry& camera, const Eigen::Vector2d& spacing_mm) {
  return ((spacing_mm - camera.pixel_spacing_mm).cwiseAbs().array() <=
          kMaxSpacingShare * camera.pixel_spacing_mm.array())
      .all();
}

/// Formats write 1 x 1 mm for a spacing that nobody has set.
void check_spacing(const LoadedImage& loaded,
                   const StudyView& view,
                   const CameraGeometry& camera,
                   std::vector<std::string>& warnings) {
  if (view.reading.ignores_spacing) return;
  const auto spacing_mm = loaded.dicom
                              ? imager_spacing_mm(loaded.dicom->header, loaded.dicom->frame)
                              : loaded.spacing_mm;
  if (spacing_mm) {
    if ((!loaded.dicom && *spacing_mm == Eigen::Vector2d::Ones()) ||
        is_spacing_of(camera, *spacing_mm))
      return;
    throw InputError(loaded.dicom ? "ImagerPixelSpacing" : "pixel spacing",
                     spacing_text(*spacing_mm),
                     "must equal pixel_spacing_mm of camera '" + camera.name +
                         "': " + spacing_text(camera.pixel_spacing_mm) +
                         " (column, row); correct the rig or the file, or set xray_spacing = "
                         "\"ignore\"",
                     view.xray.string());
  }
  if (!loaded.dicom) return;
  std::optional<Eigen::Vector2d> in_patient_mm;
  try {
    in_patient_mm = xray_pixel_spacing_mm(*loaded.dicom);
  } catch (const InputError& error) {  // this would only be a warning
    warnings.push_back(std::string(error.what()) + "; not checked");
  }
  if (in_patient_mm && !is_spacing_of(camera, *in_patient_mm))
    warnings.push_back(view.xray.string() + ": PixelSpacing = " + spacing_text(*in_patient_mm) +
                       ", but camera '" + camera.name + "' has " +
                       spacing_text(camera.pixel_spacing_mm) +
                       " (no ImagerPixelSpacing: it may be that of a plane in the patient)");
}

/// What is known of a file's values and done to them, in the order in which it is done.
class Note {
 public:
  void add(const std::string& what) { text_ += (text_.empty() ? "" : ", ") + what; }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

void note_header(const DicomXray& dicom, Note& note) {
  std::string what = "DICOM " + (dicom.modality.empty() ? "image" : dicom.modality);
  if (dicom.frames > 1)
    what += " frame " + std::to_string(dicom.frame) + " of " + std::to_string(dicom.frames);
  note.add(what + ", " + std::to_string(dicom.stored_bits) + " bits");
  note.add(dicom.is_monochrome1 ? "MONOCHROME1" : "MONOCHROME2");
  if (!dicom.relationship_text.empty())
    note.add("PixelIntensityRelationship " + dicom.relationship_text +
             (dicom.sign ? (*dicom.sign > 0 ? " +1" : " -1") : ""));
  if (dicom.is_rescaled) note.add("rescaled");
  if (!dicom.modality_lut.empty())
    note.add("Modality LUT applied (" + dicom.modality_lut + ")" +
             (dicom.was_linearised ? ", which makes logarithms intensities" : ""));
  if (!dicom.intensity_function.empty())
    note.add("frame's intensity LUT " + dicom.intensity_function + " not applied");
  if (!dicom.window.empty()) note.add("window " + dicom.window + " ignored");
}

void check_relationship(const DicomXray& dicom,
                        const StudyView& view,
                        std::vector<std::string>& warnings) {
  const std::string file = view.xray.string();
  const bool is_intensity = view.xray_domain == XrayDomain::Intensity;
  if (dicom.relationship == PixelIntensity::Logarithmic && is_intensity)
    throw InputError("PixelIntensityRelationship",
                     "LOG",
                     "the values are logarithms: set xray_domain = \"attenuation\" (their scale "
                     "is not known)",
                     file);
  if (dicom.relationship == PixelIntensity::Logarithmic)
    warnings.push_back(file +
                       ": PixelIntensityRelationship = LOG: line integrals up to an unknown scale "
                       "and offset");
  if (dicom.relationship == PixelIntensity::Linear && !is_intensity)
    warnings.push_back(file +
                       ": PixelIntensityRelationship = LIN, but xray_domain = \"attenuation\" "
                       "takes no logarithm");
  if (dicom.relationship == PixelIntensity::Display || dicom.relationship == PixelIntensity::Other)
    warnings.push_back(file + ": PixelIntensityRelationship = " + dicom.relationship_text +
                       ": the values were made for display and are not proportional to "
                       "intensity; edges remain, line integrals do not");
  if (dicom.modality == "CT" || dicom.modality == "MR")
    warnings.push_back(file + ": Modality = " + dicom.modality + " is no X-ray");
}

/// Whether stored values must be inverted so that they rise with what `xray_domain` says.
bool is_turned(const LoadedImage& loaded, const StudyView& view) {
  if (view.reading.polarity != XrayPolarity::ByHeader)
    return view.reading.polarity == XrayPolarity::Inverted;
  if (!loaded.dicom) return false;
  const bool wants_intensity = view.xray_domain == XrayDomain::Intensity;
  if (loaded.dicom->sign) return (*loaded.dicom->sign > 0) != wants_intensity;
  return loaded.dicom->is_monochrome1;
}

/// The number from which values are subtracted to invert them. DICOM's stored bits give it;
/// otherwise it is the least full scale of a detector that holds all values.
double inversion_sum(const LoadedImage& loaded) {
  if (loaded.dicom) return loaded.dicom->inversion_sum;
  const auto most = static_cast<double>(
      *std::max_element(loaded.image.pixels.begin(), loaded.image.pixels.end()));
  constexpr std::array<double, 5> kFullScales = {255.0, 1023.0, 4095.0, 16383.0, 65535.0};
  const bool integers = std::all_of(loaded.image.pixels.begin(),
                                    loaded.image.pixels.end(),
                                    [](float value) { return value == std::nearbyint(value); });
  const auto scale = std::find_if(
      kFullScales.begin(), kFullScales.end(), [&](double full) { return full >= most; });
  return integers && scale != kFullScales.end() ? *scale : most;
}

void turn_round(Image2d& image, double sum) {
  for (float& value : image.pixels) value = static_cast<float>(sum - static_cast<double>(value));
}

void check_values(const Image2d& image, const StudyView& view) {
  const std::string file = view.xray.string();
  const bool may_be_negative = view.xray_domain != XrayDomain::Intensity || view.reading.dark ||
                               view.reading.dark_level != 0.0;
  const auto negative =
      std::find_if(image.pixels.begin(), image.pixels.end(), [](float v) { return v < 0.0f; });
  if (!may_be_negative && negative != image.pixels.end()) {
    const auto at = static_cast<std::size_t>(negative - image.pixels.begin());
    const auto width = static_cast<std::size_t>(image.width);
    throw InputError(
        "pixel (" + std::to_string(at % width) + ", " + std::to_string(at / width) + ")",
        std::to_string(*negative),
        "intensities must not be negative (xray_domain = \"attenuation\"?)",
        file);
  }
  const float first = image.pixels.front();
  if (std::ranges::all_of(image.pixels, [&](float value) { return value == first; }))
    throw InputError(
        "pixels", "all " + std::to_string(first), "a constant image shows nothing", file);
}

/// Removes from a mask what another one hides. Empty ones hide nothing.
void hide(Image2d& mask, const Image2d& shown) {
  if (mask.pixels.empty()) {
    mask = shown;
    return;
  }
  for (std::size_t i = 0; i < shown.pixels.size(); ++i)
    if (shown.pixels[i] == 0.0f) mask.pixels[i] = 0.0f;
}

/// The flat or dark image of a view, inverted as its X-ray is: by the same full scale, which a flat
/// field of inverted values, all small, does not show. `mask` loses its padding. `kept`: the file,
/// which is read if it has not been yet.
Image2d load_companion(const std::filesystem::path& path,
                       const StudyView& view,
                       const CameraGeometry& camera,
                       std::optional<double> sum_of_xray,
                       std::optional<LoadedImage>& kept,
                       Image2d& mask) {
  if (!kept.has_value()) {
    LoadedImage read = load(path, std::nullopt);
    check_size(read.image, path.string(), camera);
    kept = std::move(read);
  }
  LoadedImage loaded = *kept;
  hide(mask, loaded.data);
  if (!is_turned(loaded, view)) return std::move(loaded.image);
  const double sum =
      loaded.dicom ? loaded.dicom->inversion_sum : sum_of_xray.value_or(inversion_sum(loaded));
  const float most = *std::max_element(loaded.image.pixels.begin(), loaded.image.pixels.end());
  if (static_cast<double>(most) > sum)
    throw InputError(
        "largest value",
        number_text(static_cast<double>(most)),
        "must not exceed " + number_text(sum) +
            ", the full scale from which the X-ray's values were subtracted to invert them",
        path.string());
  turn_round(loaded.image, sum);
  return std::move(loaded.image);
}

/// Whether correct_by_flat() changes a view's X-ray.
bool has_corrections(const StudyView& view) {
  const XrayReading& reading = view.reading;
  return view.xray_domain == XrayDomain::Intensity &&
         (reading.flat || reading.dark || reading.dark_level != 0.0);
}

/// The companion files of a view's X-ray that have been read.
struct ReadCompanions {
  std::optional<LoadedImage> flat;
  std::optional<LoadedImage> dark;
};

/// Applies the dark and flat fields of a view, if it has them. `mask` loses pixels without a beam.
void correct_by_flat(const StudyView& view,
                     const CameraGeometry& camera,
                     std::optional<double> sum_of_xray,
                     ReadCompanions& read,
                     Image2d& image,
                     Image2d& mask,
                     Note& note) {
  const XrayReading& reading = view.reading;
  Image2d dark;
  if (reading.dark) {
    dark = naming_study_line(view.places, "dark", [&] {
      return load_companion(*reading.dark, view, camera, sum_of_xray, read.dark, mask);
    });
    note.add("dark image subtracted");
  } else if (reading.dark_level != 0.0) {
    dark = Image2d(image.width, image.height);
    std::fill(dark.pixels.begin(), dark.pixels.end(), static_cast<float>(reading.dark_level));
    note.add("dark level " + number_text(reading.dark_level) + " subtracted");
  }
  if (!reading.flat) {
    for (std::size_t i = 0; i < dark.pixels.size(); ++i) image.pixels[i] -= dark.pixels[i];
    return;
  }
  const Image2d flat = naming_study_line(view.places, "flat", [&] {
    return load_companion(*reading.flat, view, camera, sum_of_xray, read.flat, mask);
  });
  std::size_t dead = 0;
  for (std::size_t i = 0; i < flat.pixels.size(); ++i)
    if (!(flat.pixels[i] > (dark.pixels.empty() ? 0.0f : dark.pixels[i]))) {
      if (mask.pixels.empty()) {
        mask = Image2d(image.width, image.height);
        std::fill(mask.pixels.begin(), mask.pixels.end(), 1.0f);
      }
      mask.pixels[i] = 0.0f;
      ++dead;
    }
  if (static_cast<double>(dead) > kMostDeadPixels * static_cast<double>(flat.pixels.size()))
    throw InputError("flat",
                     std::to_string(dead) + " of " + std::to_string(flat.pixels.size()) +
                         " pixels not above the dark image",
                     "must be an X-ray of the open beam",
                     reading.flat->string());
  image = flat_corrected(image, flat, dark);
  note.add("air level 1 by the flat field" +
           (dead > 0 ? " (" + std::to_string(dead) + " dead pixels masked)" : std::string()));
}

std::string percent(double share) {
  return number_text(std::round(1000.0 * share) / 10.0) + " %";
}

std::vector<float> values_in(const Image2d& image, const Image2d& mask) {
  if (mask.pixels.empty()) return image.pixels;
  std::vector<float> values;
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    if (mask.pixels[i] != 0.0f) values.push_back(image.pixels[i]);
  return values;
}

double percentile_level(const Image2d& image, const Image2d& mask, const StudyView& view) {
  const std::vector<float> values = values_in(image, mask);
  const double level =
      values.empty() ? 0.0 : static_cast<double>(nearest_rank(values, kOpenBeamShare));
  if (!(level > 0.0))
    throw InputError("open-beam intensity (99.9th percentile)",
                     std::to_string(level),
                     "must be positive",
                     view.xray.string());
  return level;
}

double air_level(const Image2d& image,
                 const XrayBorders& borders,
                 const Image2d& field,
                 const StudyView& view,
                 Note& note) {
  const auto told = [&](double level, const std::string& how) {
    note.add("air level " + number_text(level) + " (" + how + ")");
    return level;
  };
  if (view.reading.flat) return 1.0;
  switch (view.reading.air) {
    case AirSource::Value:
      return told(view.reading.air_level, "stated");
    case AirSource::OpenBeam: {
      const auto air = open_beam_peak(values_in(image, field));
      if (!air)
        throw InputError(
            "air_level",
            "\"open-beam\"",
            "no grey level is common to 3 % of the pixels: is there air in view? If not, state a "
            "number or a flat field",
            view.xray.string());
      return told(air->level, "open beam: " + percent(air->share) + " of the field within 10 %");
    }
    case AirSource::CollimatedBorders: {
      if (!(borders.aperture_share > 0.0))
        throw InputError("air_level",
                         "\"collimated-borders\"",
                         "no collimator or aperture was found; state \"open-beam\", a number or a "
                         "flat field",
                         view.xray.string());
      const AirLevel air = air_beside_edge(image, borders.mask);
      if (!(air.level > 0.0))
        throw InputError("air_level",
                         number_text(air.level) + " beside the edge of the field",
                         "must be positive",
                         view.xray.string());
      return told(air.level, "90th percentile beside the collimated edge");
    }
    case AirSource::Percentile:
      return told(percentile_level(image, field, view), "99.9th percentile");
    case AirSource::NotAsked:
      break;
  }
  return told(percentile_level(image, field, view),
              "99.9th percentile, the default: too low where no air is in view; see air_level");
}

/// Intensities of an attenuation image, up to scale: exp(-value). Values that exceed a few units
/// (logarithms of an unknown scale) are first put on a scale of four units from air to the densest.
Image2d intensities_of(const Image2d& attenuation) {
  constexpr double kUnits = 4.0;
  const auto low = static_cast<double>(nearest_rank(attenuation.pixels, 0.01));
  const auto high = static_cast<double>(nearest_rank(attenuation.pixels, 0.99));
  const double unit = std::max(1.0, (high - low) / kUnits);
  Image2d intensity = attenuation;
  for (float& value : intensity.pixels)
    value = static_cast<float>(std::exp(-(static_cast<double>(value) - low) / unit));
  return intensity;
}

XrayBorders borders_of(const Image2d& image, XrayDomain domain) {
  return find_xray_borders(domain == XrayDomain::Intensity ? image : intensities_of(image));
}

/// Borders are looked for only where needed, because that takes a while on large pictures.
bool needs_borders(const StudyView& view, Background background) {
  const Background unexpected =
      view.xray_domain == XrayDomain::Intensity ? Background::Dark : Background::Bright;
  return view.reading.masks_borders || view.reading.air == AirSource::CollimatedBorders ||
         background == unexpected;
}

void note_background(Background found,
                     const Image2d& image,
                     const StudyView& view,
                     const XrayBorders& borders,
                     const Image2d& field,
                     Note& note,
                     std::vector<std::string>& warnings) {
  if (found == Background::Undecided) return;
  const bool is_bright = found == Background::Bright;
  const bool is_intensity = view.xray_domain == XrayDomain::Intensity;
  const bool is_expected = is_bright == is_intensity;
  const bool is_plainly_shut = borders.circle.has_value() || borders.straight_sides > 2;
  const bool is_intensity_by_detail =
      is_intensity && !is_expected && bright_detail(image, field) > 0.0;
  note.add(std::string("background looks ") + (is_bright ? "bright" : "dark") +
           (is_intensity_by_detail ? ", detail grows with brightness: no negative" : "") +
           (is_intensity_by_detail && is_plainly_shut && !view.reading.masks_borders
                ? "; borders? (mask = \"auto\")"
                : ""));
  if (is_expected || is_intensity_by_detail) return;
  const bool may_be_border = borders.is_any() && !view.reading.masks_borders;
  const std::string domain = is_intensity ? "intensity" : "attenuation";
  warnings.push_back(view.xray.string() + ": its background looks " +
                     (is_bright ? "bright" : "dark") + ", but xray_domain = \"" + domain +
                     "\" means " + (is_bright ? "dark" : "bright") + " air; " +
                     (may_be_border ? "a collimator or aperture (mask = \"auto\")? " : "") +
                     "if its greys are inverted, set xray_polarity = \"inverted\"; anatomy "
                     "that fills the picture can look like this, too");
}

double hidden_share(const Image2d& mask, const RegionOfInterest& roi) {
  const Image2d part = crop(mask, roi);
  return static_cast<double>(std::count(part.pixels.begin(), part.pixels.end(), 0.0f)) /
         static_cast<double>(part.pixels.size());
}

/// Applies an automatic mask, checked against the region of interest.
void use_borders(const XrayBorders& borders, const StudyView& view, Image2d& mask, Note& note) {
  note.add(borders.text());
  if (borders.is_any()) hide(mask, borders.mask);
  if (mask.pixels.empty() || view.roi.pixel_count() == 0) return;
  const double hidden = hidden_share(mask, view.roi);
  if (hidden > kMostHidden)
    throw InputError("mask",
                     "\"auto\": " + borders.text(),
                     "hides " + percent(hidden) +
                         " of roi_px, which cannot be border: draw a mask, or leave it out",
                     view.xray.string());
}

/// The mask as the camera without distortion sees it. Refuses a distortion that leaves too little.
void undistort_mask(const XrayUndistortion& undistortion,
                    const StudyView& view,
                    Image2d& mask,
                    Note& note) {
  const bool has_mask = !mask.pixels.empty();
  mask = undistortion.mask(mask);
  note.add(undistortion.text());
  if (!has_mask && view.roi.pixel_count() > 0 && hidden_share(mask, view.roi) > kMostHidden)
    throw InputError("distortion",
                     undistortion.text(),
                     "leaves more than half of roi_px without data",
                     view.xray.string());
  if (std::none_of(mask.pixels.begin(), mask.pixels.end(), [](float v) { return v != 0.0f; }))
    throw InputError("distortion", undistortion.text(), "leaves no pixel", view.xray.string());
}

Image2d read_mask_file(const StudyView& view, const CameraGeometry& camera) {
  Image2d mask = read_image(*view.mask);
  check_size(mask, view.mask->string(), camera);
  if (std::none_of(mask.pixels.begin(), mask.pixels.end(), [](float v) { return v != 0.0f; }))
    throw InputError("mask", "all 0", "must let at least one pixel through", view.mask->string());
  return mask;
}

/// Gives padding the value of a border, so that the search for borders finds none of another kind:
/// the darkest intensity, or the densest attenuation.
void darken_padding(XrayDomain domain, LoadedImage& loaded) {
  const std::vector<float> values = values_in(loaded.image, loaded.data);
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  const float border = domain == XrayDomain::Intensity ? *low : *high;
  for (std::size_t i = 0; i < loaded.data.pixels.size(); ++i)
    if (loaded.data.pixels[i] == 0.0f) loaded.image.pixels[i] = border;
}

void check_padding(const LoadedImage& loaded, const StudyView& view, Note& note) {
  const RegionOfInterest whole = {0, 0, loaded.data.width, loaded.data.height};
  note.add(percent(hidden_share(loaded.data, whole)) + " masked as padding (" +
           loaded.dicom->padding + ")");
  if (view.roi.pixel_count() == 0) return;
  const double hidden = hidden_share(loaded.data, view.roi);
  if (hidden > kMostHidden)
    throw InputError(
        loaded.dicom->padding,
        "padding",
        "hides " + percent(hidden) +
            " of roi_px; if these pixels are data, the file must not call them padding",
        view.xray.string());
}

/// The X-ray's values, rising with what `xray_domain` says, and notes on what was done for that.
/// `inversion` is what they were subtracted from.
LoadedImage oriented(LoadedImage loaded,
                     const StudyView& view,
                     const CameraGeometry& camera,
                     std::optional<double>& inversion,
                     Note& note,
                     std::vector<std::string>& warnings) {
  check_size(loaded.image, view.xray.string(), camera);
  check_spacing(loaded, view, camera, warnings);
  if (!loaded.note.empty()) note.add(loaded.note);
  if (loaded.dicom) {
    note_header(*loaded.dicom, note);
    check_relationship(*loaded.dicom, view, warnings);
  }
  if (is_turned(loaded, view)) {
    inversion = inversion_sum(loaded);
    turn_round(loaded.image, *inversion);
    note.add("values inverted: " + number_text(*inversion) + " - stored");
  }
  if (!loaded.data.pixels.empty()) {
    darken_padding(view.xray_domain, loaded);
    check_padding(loaded, view, note);
  }
  return loaded;
}

}  // namespace

/// What was read or computed once for all X-rays of the view.
struct ViewXrayReader::Kept {
  std::optional<Image2d> mask;
  ReadCompanions companions;
  std::optional<XrayUndistortion> undistortion;
};

ViewXrayReader::ViewXrayReader(StudyView view, CameraGeometry camera)
    : view_(std::move(view)), camera_(std::move(camera)), kept_(std::make_shared<Kept>()) {}

ViewXray ViewXrayReader::read() {
  return prepared(view_, [&] { return load(view_.xray, view_.reading.frame); });
}

ViewXray ViewXrayReader::prepared(Image2d values) {
  StudyView given = view_;
  given.xray = "X-ray of '" + camera_.name + "'";
  given.places.erase("xray");
  return prepared(given, [&] {
    check_is_finite(values, given.xray);
    return LoadedImage{std::move(values), std::nullopt, std::nullopt, Image2d(), ""};
  });
}

template <typename Load>
ViewXray ViewXrayReader::prepared(const StudyView& view, const Load& load_xray) {
  ViewXray xray;
  Note note;
  if (view.mask && !kept_->mask)
    kept_->mask =
        naming_study_line(view.places, "mask", [&] { return read_mask_file(view, camera_); });
  if (kept_->mask) xray.mask = *kept_->mask;
  Image2d& image = xray.attenuation;
  XrayBorders borders;
  std::optional<XrayUndistortion>& undistortion = kept_->undistortion;
  if (!camera_.distortion.is_none() && !undistortion) undistortion.emplace(camera_);
  Image2d undistorted;
  std::optional<double> inversion;
  Image2d field;  // 0: no data, or a border that mask = "auto" hides
  naming_study_line(view.places, "xray", [&] {
    LoadedImage loaded = oriented(load_xray(), view, camera_, inversion, note, xray.warnings);
    image = std::move(loaded.image);
    check_values(image, view);
    hide(xray.mask, loaded.data);
    if (undistortion) undistorted = undistortion->image(image);
    const Image2d& shown = undistortion ? undistorted : image;
    if (!loaded.data.pixels.empty())
      field = undistortion ? undistortion->mask(loaded.data) : std::move(loaded.data);
    Background background = background_of(shown, field);
    if (needs_borders(view, background)) borders = borders_of(shown, view.xray_domain);
    if (view.reading.masks_borders) {
      hide(field, borders.mask);
      background = background_of(shown, field);
    }
    note_background(background, shown, view, borders, field, note, xray.warnings);
  });
  // Flat and dark fields consist of the detector's own pixels, so they come before undistortion.
  if (view.xray_domain == XrayDomain::Intensity)
    correct_by_flat(view, camera_, inversion, kept_->companions, image, xray.mask, note);
  if (undistortion)
    naming_study_line(view.places, "xray", [&] {
      image = has_corrections(view) ? undistortion->image(image) : std::move(undistorted);
      undistort_mask(*undistortion, view, xray.mask, note);
    });
  naming_study_line(view.places, "xray", [&] {
    if (view.xray_domain == XrayDomain::Intensity)
      take_negative_log(image, air_level(image, borders, field, view, note));
    if (view.reading.masks_borders) use_borders(borders, view, xray.mask, note);
  });
  if (note.text().empty()) note.add("attenuation as the file has it");
  xray.note = note.text();
  return xray;
}

ViewXray read_view_xray(const StudyView& view, const CameraGeometry& camera) {
  return ViewXrayReader(view, camera).read();
}

}  // namespace af
