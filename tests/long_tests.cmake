# SPDX-License-Identifier: Apache-2.0
# `tests/run.sh --fast` leaves out these tests, which get the label `long`. A name stands for a program of tests, a CTest
# entry, all entries that begin with it and a dot, or one TEST. Without them, physics, and MPI on more than two ranks, the
# seconds of all others in Testing/Temporary/CTestCostData.txt add up to less than 300.
set(af_long_tests
    # Programs of tests, and CTest entries
    Pages atlas_program bad_inputs bones checks.scripts convert.mutations convert.program evaluate_program_tests
    evaluate_stops_tests fault_tests help_formats_tests kill_matrix_tests launch_tests leak_tests library_installed_example
    library_study library_test measured_fields_tests population_program precompute_program python real_xrays_program register_program_tests
    report_program scan_program_tests simulate_program_tests snakemake_program spectrum_program_tests viewpoint_cylinder_test
    # Single tests of more than three seconds
    AfInspect.DrawsOneDrrWhereRoughLandmarksGiveTheNominalPose
    AfInspect.DrawsPicturesOfACtAndOfAStudy
    AfInspect.VerifiesAFieldAndAStudyAndSeesDamage
    Correction.IsOfAnyOptimiserAndTheSearchThatItDoesByRayCasting
    Correction.OfAnImageThatStaysEndsBetterByEveryMeasureAndWhereRayCastingDoes
    CtIdentity.OfAThousandRewrittenCtsIsThatOfTheSameAndOfNoOtherOnes
    HandBuiltResults.GiveAReportAlsoWhenNothingSucceeded
    HandBuiltResults.InAChainGiveTheKnownErrorBudget
    Orbit.EveryPoseAtEveryAngleIsAMembers
    Orbit.EveryRayAtEveryAngleIsHeldByOneMember
    RayCastLevel.DrrAndDerivativesAgreeWithTheFieldsLevel
    RayCaster.SphereAndEllipsoidGiveMuTimesChordLength
    Registration.EveryMeasureIsBestNearTheKnownPose
    SelfCalibration.FindsAKnownWobbleFromEvenViewsForOddOnes
    SelfCalibration.TakesTheStatedDirectionWhereImagesTellNone
    SourceRegion.NoRayFromWithinMissesTheNarrowedPlanes
    convert.cameras)
