#include "io/reports/fit_report.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "io/reports/accuracy_file.h"
#include "plot/svg_plot.h"
#include "scratch_folder.h"

namespace stipple {
namespace {

class FitReportFile : public ScratchFolder {};

FitHistory history(size_t iterations) {
  FitHistory made;
  for (size_t i = 0; i < iterations; ++i) {
    FitRecord record;
    record.loss = 0.3f * std::exp(-static_cast<float>(i) / 300.0f) + 0.02f +
                  0.004f * static_cast<float>(i * 7 % 11) / 11.0f;
    record.l1 = record.loss / 2;
    record.ssim = 1 - record.loss;
    record.splat_count = static_cast<uint32_t>(1000 + 20 * i);
    record.render_seconds = 0.004f + 1e-6f * static_cast<float>(i);
    record.backward_seconds = 0.009f + 2e-6f * static_cast<float>(i);
    record.optimiser_seconds = 0.002f;
    record.other_seconds = 0.001f;
    made.records.push_back(record);
    if ((i + 1) % 100 != 0) continue;
    FitMeasure measure;
    measure.iteration = i + 1;
    measure.splat_count = record.splat_count;
    measure.psnr = 24 - 8 * std::exp(-static_cast<double>(i) / 400);
    measure.foreground_psnr = measure.psnr - 4;
    measure.ssim = 0.8;
    measure.density_entropy = 11 - static_cast<double>(i) / 1000;
    made.measures.push_back(measure);
  }
  for (const uint64_t budget : {512, 1024, 2048, 4096}) {
    FitMeasure measure;
    measure.iteration = 1000;
    measure.budget = budget;
    measure.splat_count = 8 * budget;
    measure.psnr = 12 + std::log2(static_cast<double>(budget));
    measure.ssim = 0.9;
    made.by_budget.push_back(measure);
  }
  made.best_iteration = 1000;
  made.training_view_count = 42;
  made.measured_view_count = 6;
  return made;
}

TEST_F(FitReportFile, HoldsTheWholeStoryAsJson) {
  FitHistory told = history(1000);
  told.records[3].loss = std::numeric_limits<float>::quiet_NaN();
  writeFitReport({"explicit", "adaptive", "{\"seed\": 4}"}, told, path("r.json"));
  const auto seen = nlohmann::json::parse(load(path("r.json")));
  EXPECT_EQ(seen["model"], "explicit");
  EXPECT_EQ(seen["strategy"], "adaptive");
  EXPECT_EQ(seen["settings"]["seed"], 4);
  EXPECT_EQ(seen["iterations"], 1000);
  EXPECT_EQ(seen["measured_on"], "held-out views");
  ASSERT_EQ(seen["by_iteration"]["loss"].size(), 1000u);
  EXPECT_TRUE(seen["by_iteration"]["loss"][3].is_null());
  EXPECT_NEAR(seen["by_iteration"]["loss"][999].get<double>(),
              static_cast<double>(told.records[999].loss), 1e-6);
  EXPECT_EQ(seen["by_iteration"]["gaussians"][999], 20980);
  EXPECT_EQ(seen["by_iteration"]["seconds"]["render"].size(), 1000u);
  EXPECT_EQ(seen["measures"].size(), 10u);
  EXPECT_EQ(seen["measures"][9]["iteration"], 1000);
  EXPECT_EQ(seen["by_budget"][3]["budget"], 4096);
  EXPECT_DOUBLE_EQ(seen["by_budget"][3]["psnr"].get<double>(), 24.0);
  // Parts add up: 9.499 + 9.998 + 2 + 1 s.
  EXPECT_NEAR(seen["seconds"]["all"].get<double>(), 0.0 + 4.4995 + 9.999 + 2 + 1, 1e-2);
  expectError(ErrorCode::kInvalidArgument, {"settings", "JSON"}, [&] {
    writeFitReport({"explicit", "", "{"}, told, path("never.json"));
  });
  EXPECT_EQ(fileCount(), 1u);
}

TEST_F(FitReportFile, DrawsEveryFigureOnce) {
  writeFitPlots(history(1000), path("r.svg"));
  const std::string svg = load(path("r.svg"));
  for (const char* text :
       {"<svg ", ">Loss<", ">Quality on held-out views<", ">Quality by budget, held-out views<",
        ">Splats<", ">Time of an iteration<", ">Entropy of the density<", ">PSNR, dB<",
        ">milliseconds<", ">nats<", ">backward<", "</svg>"}) {
    EXPECT_NE(svg.find(text), std::string::npos) << text;
  }
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg.find(">edit<"), std::string::npos);  // it took no time
}

TEST_F(FitReportFile, SaysWhereNothingWasMeasured) {
  writeFitPlots(FitHistory(), path("r.svg"));
  EXPECT_NE(load(path("r.svg")).find("nothing was measured"), std::string::npos);
}

TEST(SvgPlot, PutsPointsWhereTheAxesSay) {
  PlotPanel panel{"A < B", "x", "y", false, false, true, {}};
  PlotLine line;
  line.x = {0, 50, 100, std::numeric_limits<double>::quiet_NaN()};
  line.y = {0, 5, 10, 3};
  panel.lines = {line};
  const std::string svg = svgOf(sheetOf({panel}));
  // The plot spans 70..464 x 272..34; the upper end of y is 10 + 5 % of 10.
  EXPECT_NE(svg.find("points=\"70.0,272.0 267.0,158.7 464.0,45.3 \""), std::string::npos) << svg;
  EXPECT_NE(svg.find("A &lt; B"), std::string::npos);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
}

TEST(SvgPlot, ShowsOneValueAndLogarithms) {
  PlotPanel panel{"One", "x", "y", true, true, false, {}};
  PlotLine line;
  line.x = {1000, -1};
  line.y = {0.01, 5};
  panel.lines = {line};
  const std::string svg = svgOf(sheetOf({panel}));
  EXPECT_NE(svg.find(">1000<"), std::string::npos);
  EXPECT_NE(svg.find(">0.01<"), std::string::npos);
}

TEST(SvgPlot, HasTicksWhereALogarithmicAxisIsShort) {
  PlotPanel panel{"Short", "x", "y", true, true, false, {}};
  PlotLine line;
  line.x = {122, 169};  // no 1, 2 or 5 times a power of ten lies between
  line.y = {1, 100};
  panel.lines = {line};
  const std::string svg = svgOf(sheetOf({panel}));
  for (const char* tick : {">130<", ">140<", ">150<", ">160<"}) {
    EXPECT_NE(svg.find(tick), std::string::npos) << tick;
  }
}

TEST_F(FitReportFile, TellsWhatIterationsCostAndBrought) {
  const FitHistory made = history(1000);
  writeFitReport({"explicit", "adaptive", "{}"}, made, path("fit.json"));
  const AccuracyReport report = readFitAccuracy(path("fit.json"));
  EXPECT_EQ(report.subject, AccuracySubject::kFit);
  ASSERT_EQ(report.rows.size(), 10u);
  double seconds = 0;
  for (size_t i = 0; i < 1000; ++i) {
    const FitRecord& r = made.records[i];
    for (const float part : {r.render_seconds, r.backward_seconds, r.field_seconds,
                             r.optimiser_seconds, r.edit_seconds, r.other_seconds}) {
      seconds += static_cast<double>(part);
    }
    if ((i + 1) % 100 != 0) continue;
    const AccuracyRow& row = report.rows[i / 100];
    EXPECT_EQ(row.name, "iteration " + std::to_string(i + 1));
    EXPECT_EQ(row.value, static_cast<double>(i + 1));
    EXPECT_NEAR(row.seconds, seconds, 1e-5 * seconds);  // six digits are written
    EXPECT_NEAR(row.psnr, made.measures[i / 100].psnr, 1e-9);
    EXPECT_EQ(row.splat_count, made.records[i].splat_count);
    EXPECT_TRUE(std::isnan(row.largest_error)) << "no fit writes it down";
  }
  writeAccuracyReport(report, path("cost.json"));
  writeAccuracyReport(report, path("cost.csv"));
  writeAccuracyReport(report, path("cost.svg"));
  const auto json = nlohmann::json::parse(load(path("cost.json")));
  EXPECT_EQ(json["subject"], "fit");
  EXPECT_EQ(json["settings"][3]["iteration"], 400);
  EXPECT_TRUE(json["settings"][3]["largest_error"].is_null());
  EXPECT_NE(load(path("cost.svg")).find("seconds of a fit"), std::string::npos);
}

TEST_F(FitReportFile, OtherFilesAreNoCosts) {
  const auto refused = [&](const std::string& text, const char* why) {
    const std::string file = store("other.json", text);
    try {
      readFitAccuracy(file);
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(why), std::string::npos) << error.what();
    }
  };
  refused("{}", "is not the report of a fit");
  refused("[1", "is not the report of a fit");
  refused(R"({"stipple_fit_report": 2})", "it is of version 2; 1 is what this library reads");
  const std::string head = R"({"stipple_fit_report": 1, "iterations": 2, "measures": )";
  refused(head + R"([], "by_iteration": {"seconds": {"render": [1, 2]}}})", "0 measurements");
  refused(head + R"([], "by_iteration": {"seconds": {"render": [1]}}})",
          "1 times for 2 iterations");
  refused(head + R"([{"iteration": 3, "psnr": 1, "gaussians": 1}],
                 "by_iteration": {"seconds": {"render": [1, 2]}}})",
          "it measured iteration 3 of 2");
  EXPECT_THROW(readFitAccuracy(path("none.json")), Error);
}

TEST_F(FitReportFile, ReplacesAReportAndItsCurvesButNoOtherFile) {
  const std::string name = path("r.json"), curves = fitPlotsPath(name);
  for (int i = 0; i < 2; ++i) {
    EXPECT_NO_THROW(requireFitReportPlace(name));
    writeFitReport({"explicit", "", "{}"}, history(100), name);
    writeFitPlots(history(100), curves);
  }
  store("r.svg", "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"10\"></svg>");
  expectError(ErrorCode::kInvalidArgument, {"r.svg", "another kind"},
              [&] { requireFitReportPlace(name); });
  expectError(ErrorCode::kInvalidArgument, {"r.svg"}, [&] { writeFitPlots(history(100), curves); });
  for (const char* other : {"transforms.json", "scan.ply", "notes"}) {
    const std::string mine = store(other, "{\"frames\": []}");
    expectError(ErrorCode::kInvalidArgument, {other, "another kind", "the report of a fit"}, [&] {
      writeFitReport({"explicit", "", "{}"}, history(100), mine);
    });
    EXPECT_EQ(load(mine), "{\"frames\": []}");
  }
  expectError(ErrorCode::kInvalidArgument, {"new.svg", ".json is expected"},
              [&] { requireFitReportPlace(path("new.svg")); });
}

TEST_F(FitReportFile, AReportOfAccuracyReplacesItsLikeAlone) {
  AccuracyReport report;
  report.rows.resize(1);
  for (const char* name : {"a.json", "a.csv", "a.svg"}) {
    writeAccuracyReport(report, path(name));
    EXPECT_NO_THROW(writeAccuracyReport(report, path(name))) << name;
    store(name, "mine,1,2");
    expectError(ErrorCode::kInvalidArgument, {name, "another kind"},
                [&] { writeAccuracyReport(report, path(name)); });
    EXPECT_EQ(load(path(name)), "mine,1,2");
  }
}

}  // namespace
}  // namespace stipple
