#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# try-elastix.sh FOLDER: whether the installed elastix can cast rays, which registering an X-ray with a CT needs: asks it
# for the interpolators of its 2D-3D parameter files and prints what it answers.
set -euo pipefail

folder=$1
mkdir -p "$folder/out"
cd "$folder"
elastix --version

# image FILE SIZE: a cube of zeros, which is all that naming components takes.
image() {
  {
    printf 'ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nOffset = 0 0 0\n'
    printf 'ElementSpacing = 1 1 1\nDimSize = %d %d %d\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n' "$2" "$2" "$2"
    head -c $(($2 * $2 * $2)) /dev/zero
  } >"$1"
}
image fixed.mha 8
image moving.mha 8

parameters() {
  cat <<TEXT
(FixedImageDimension 3)
(MovingImageDimension 3)
(Registration "MultiResolutionRegistration")
(Interpolator "$1")
(ResampleInterpolator "$2")
(Metric "$3")
(Optimizer "AdaptiveStochasticGradientDescent")
(Resampler "DefaultResampler")
(Transform "EulerTransform")
(FixedImagePyramid "FixedRecursiveImagePyramid")
(MovingImagePyramid "MovingRecursiveImagePyramid")
(ImageSampler "Full")
(NumberOfResolutions 1)
(MaximumNumberOfIterations 1)
TEXT
}

# try INTERPOLATOR RESAMPLER METRIC
try() {
  local missing
  parameters "$1" "$2" "$3" >parameters.txt
  elastix -f fixed.mha -m moving.mha -p parameters.txt -out out >answer.txt 2>&1 || true
  missing=$(sed -n 's/(index [0-9]*) - This component is not installed!//p' answer.txt | sort -u | tr '\n' ' ')
  printf '%s, %s, %s: %s\n' "$1" "$2" "$3" "${missing:+not installed: }${missing:-all components are there}"
}
try LinearInterpolator FinalBSplineInterpolator AdvancedNormalizedCorrelation
try RayCastInterpolator FinalBSplineInterpolator AdvancedNormalizedCorrelation
try LinearInterpolator RayCastResampleInterpolator AdvancedNormalizedCorrelation
try LinearInterpolator FinalBSplineInterpolator NormalizedGradientCorrelation
try LinearInterpolator FinalBSplineInterpolator PatternIntensity
try LinearInterpolator FinalBSplineInterpolator GradientDifference
