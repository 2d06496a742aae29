#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "catch_shim.hpp"
#include "numbers/numbers.hpp"
#include "numbers/reading.hpp"

using namespace numbers_test;

// ---- one number a row

TEST_CASE("numbers as programs write them are read", "[numbers][exact]") {
  // `%+e` of C, Fortran, MSVC and spreadsheets; "+5.7e-02" was no number, so that only negative ones were averaged
  const std::vector<std::pair<std::string, double>> written = {{"+5.7e-02", 0.057}, {"-5.7e-02", -0.057},
                                                               {"1.", 1},           {".5", 0.5},
                                                               {"+.5", 0.5},        {"-.5", -0.5},
                                                               {"1e5", 1e5},        {"1E+05", 1e5},
                                                               {"+1E5", 1e5},       {"1d-3", 1e-3},
                                                               {"+1.5D+02", 150},   {"  7\t", 7},
                                                               {"\"8\"", 8},        {"007", 7},
                                                               {"5e-324", 5e-324},  {"1e308", 1e308},
                                                               {"-0", 0},           {"2.5E-310", 2.5e-310},
                                                               {"1e0", 1},          {"3 # three", 3}};
  for (const auto& [text, value] : written) {
    INFO(text);
    CHECK(values_of("1\n" + text + "\n2\n") == Values{1, value, 2});
    CHECK(values_of(text + "\n2\n") == Values{value, 2});
  }
  for (const std::string text : {"inf", "+inf", "Infinity", "1.#INF"}) CHECK(std::isinf(values_of("1\n" + text)[1]));
  for (const std::string text : {"nan", "NaN", "-nan", "nan(ind)", "-1.#IND"}) {
    CHECK(std::isnan(values_of("1\n" + text)[1]));
  }
}

TEST_CASE("what is no number is left out, counted, and named by its row", "[numbers][exact]") {
  for (const std::string text :
       {"abc", "0x10", "1e999", "1e-999", "++5", "+-5",  "+",    "-",    ".",   "1 2", "1_000", "1'000", "5%",
        "1e",  "1d",   "1d5x",  "NA",     "N/A", "null", "None", "#N/A", "---", "***", "1..2",  "--5",   "5 five"}) {
    const Read r = read_bytes("1\n" + text + "\n2\n");
    INFO(text);
    REQUIRE(!r.refused);
    CHECK(r.values == Values{1, 2});
    CHECK(r.rows == std::vector<std::int64_t>{1, 3});
    REQUIRE(r.report.bad_rows == 1);
    CHECK(r.report.first_bad_rows[0].row == 2);
    CHECK(r.report.first_bad_rows[0].reason.find(text) != std::string::npos);
    Request strict;
    strict.strict = true;
    CHECK(read_bytes("1\n" + text + "\n2\n", strict).refused == Cause::left_out);
  }
  const Read blank = read_bytes("1\n\n2\n\n\n");
  CHECK(blank.report.bad_rows == 1);
  CHECK(blank.report.first_bad_rows[0].reason == "empty");
  const Read zero = read_bytes("1\n2\0003\n4\n"s);
  CHECK(zero.values == Values{1, 4});
  CHECK(zero.report.first_bad_rows[0].reason.find("zero") != std::string::npos);
}

TEST_CASE("a number within a comma is refused, whatever comma it is", "[numbers][exact]") {
  CHECK(read_bytes("x\n1\n0,5\n").refused == Cause::decimal_comma);
  CHECK(read_bytes("id;flux\n1;0,5\n", column("flux")).refused == Cause::decimal_comma);
  CHECK(read_bytes("id\tflux\n1\t-0,5e3\n", column("2")).refused == Cause::decimal_comma);
  CHECK(read_bytes("1 0,5\n2 0,7\n", column("2")).refused == Cause::decimal_comma);
  CHECK(read_bytes("id,flux\n1,\"0,5\"\n", column("flux")).refused == Cause::decimal_comma);
  CHECK(read_bytes("x\n1\n1,234.5\n").refused == Cause::thousands);
  CHECK(read_bytes("x;y\n1;1,234,567\n", column("y")).refused == Cause::thousands);
  CHECK(read_bytes("id;flux\n1;0,5\n2;+1,5e1\n3;4\n", decimal_commas("flux")).values == Values{0.5, 15, 4});
  CHECK(read_bytes("0,5\n1,5\n", decimal_commas()).values == Values{0.5, 1.5});
  CHECK(read_bytes("0,5\n1.5\n", decimal_commas()).refused == Cause::decimal_point);
  CHECK(read_bytes("0,5\n1.234,5\n", decimal_commas()).refused == Cause::thousands);
  Request both = decimal_commas("flux");
  both.separator = ',';
  CHECK(read_bytes("id,flux\n1,\"0,5\"\n", both).values == Values{0.5});
  // two columns of whole numbers, or one of fractions: asked, not guessed
  CHECK(read_bytes("1,5\n2,7\n").refused == Cause::which_column);
}

// ---- the first row

TEST_CASE("a first row is a header where it cannot be a number and the rest are", "[numbers][exact]") {
  for (const std::string word : {"flux", "x [cm]", "Wert", "my value", "\"a, b\"", "% x"}) {
    const Read r = read_bytes(word + "\n1\n2\n3\n");
    INFO(word);
    CHECK(r.values == Values{1, 2, 3});
    CHECK(r.report.header);
    CHECK(r.report.header_guessed);
    CHECK(r.report.bad_rows == 0);
    CHECK(r.report.doubts.empty());
  }
  for (const std::string missing : {"NA", "null", "-", "n/a", "", "#N/A", "None", "."}) {
    const Read r = read_bytes(missing + "\n1\n2\n3\n");
    INFO(missing);
    CHECK(r.values == Values{1, 2, 3});
    CHECK(!r.report.header);
    CHECK(r.report.bad_rows == 1);
  }
  CHECK(std::isnan(read_bytes("NaN\n1\n2\n").values.at(0)));
  CHECK(read_bytes("1O5\n1\n2\n").report.bad_rows == 1);  // a slip of the finger is no name
}

TEST_CASE("a header of digits is in doubt, and is what the request says", "[numbers][exact]") {
  for (const std::string& file : {"0\n" + counted(1001, 1100), "5\n" + counted(1001, 1100), "2020\n0.5\n0.25\n0.75\n"s,
                                  "0\n0.5\n-1.25\n0.75\n"s, "0\n7\n7\n7\n"s, "1.0\n" + counted(1001, 1100)}) {
    INFO(file.substr(0, 20));
    const Read guessed = read_bytes(file);
    CHECK(!guessed.report.header);
    CHECK(doubts(guessed, Cause::header));
    const Read with = read_bytes(file, header(Header::yes));
    CHECK(with.values.size() + 1 == guessed.values.size());
    CHECK(with.report.header);
    CHECK(with.report.doubts.empty());
    const Read without = read_bytes(file, header(Header::no));
    CHECK(without.values == guessed.values);
    CHECK(without.report.doubts.empty());
    Request strict;
    strict.strict = true;
    CHECK(read_bytes(file, strict).refused == Cause::header);
  }
  for (const std::string& file : {counted(0, 100), counted(1, 100), "1.5\n2.5\n3.5\n"s, "5\n1\n2\n3\n"s,
                                  "7\n7\n7\n7\n"s, "0.5\n0.25\n10\n7\n"s, "1\n0\n1\n1\n"s}) {
    INFO(file.substr(0, 20));
    CHECK(read_bytes(file).report.doubts.empty());
  }
  CHECK(doubts(read_bytes(",0,1\n0,1.5,2.5\n1,3.5,4.5\n", column("3")), Cause::header));
  CHECK(doubts(read_bytes("0,1,2\n7,1,3\n5,9,4\n", column("3")), Cause::header));
  const Read years = read_bytes("id,2020,2021\n7,1.5,2.5\n8,3.5,4.5\n", column("2021"));
  CHECK(years.values == Values{2.5, 4.5});
  CHECK(years.report.header);
  CHECK(doubts(years, Cause::header));
  // words above words support nothing
  CHECK(read_bytes("alice,3\nbob,4\n", column("2")).values == Values{3, 4});
  CHECK(read_bytes("name,score\nbob,4\n", column("2")).values == Values{4});
  CHECK(read_bytes("flux\n1\n", header(Header::no)).report.bad_rows == 1);
}

// ---- columns

TEST_CASE("a row with more or fewer fields than the first one is refused by name", "[numbers][exact]") {
  // three fields under two names were read as flux = 0
  for (const auto& [file, row] : std::vector<std::pair<std::string, std::string>>{
           {"id,flux\n1,0,5\n", "row 2: '1,0,5' has 3 fields"},
           {"id,flux\n1,5\n2\n", "row 3: '2' has 1 field"},
           {"id;flux\n1;5\n2;5;6\n", "row 3: '2;5;6' has 3"},
           {"id flux\n1 5\n2 5 6\n", "row 3: '2 5 6' has 3"},
           {"id\tflux\n1\t5\n2\n", "row 3: '2' has 1"},
           {"id,flux,\n1,5,6,7\n", "row 2: '1,5,6,7' has 4"},
           {"id,flux,\n1,5,6\n", "row 2: '1,5,6' has 3 fields, the first row has 2"}}) {
    const Read r = read_bytes(file, column("2"));
    INFO(file << " " << r.why);
    CHECK(r.refused == Cause::ragged);
    CHECK(r.why.find(row) != std::string::npos);
  }
  // a separator at the end of rows is no field
  CHECK(values_of("id,flux\n1,5,\n2,6,\n", column("flux")) == Values{5, 6});
  CHECK(values_of("id,flux,\n1,5,\n2,6\n", column("flux")) == Values{5, 6});
  CHECK(values_of("1,\n2,\n3,\n") == Values{1, 2, 3});
}

TEST_CASE("a name of two columns is refused, a number is not", "[numbers][exact]") {
  const std::string file = "x,y,x\n1,2,3\n";
  const Read r = read_bytes(file, column("x"));
  CHECK(r.refused == Cause::doubled_name);
  CHECK(r.why.find("columns 1 and 3") != std::string::npos);
  CHECK(values_of(file, column("y")) == Values{2});
  CHECK(values_of(file, column("3")) == Values{3});
  CHECK(read_bytes(file).refused == Cause::which_column);
  CHECK(read_bytes(file, column("z")).refused == Cause::no_column);
  CHECK(read_bytes(file, column("4")).refused == Cause::no_column);
  CHECK(read_bytes(file, column("0")).refused == Cause::no_column);
}

TEST_CASE("separators are guessed from the first rows, and said", "[numbers][exact]") {
  for (const char s : {',', ';', '\t', ' '}) {
    const std::string file = "a"s + s + "b" + s + "c\n1" + s + "2" + s + "3\n4" + s + "5" + s + "6\n";
    const Read r = read_bytes(file, column("b"));
    INFO(file);
    CHECK(r.values == Values{2, 5});
    CHECK(r.report.separator == s);
    CHECK(r.report.separator_guessed);
    CHECK(r.report.columns == 3);
    Request said = column("2");
    said.separator = s;
    CHECK(!read_bytes(file, said).report.separator_guessed);
  }
  CHECK(values_of("  1   2\n 10  20\n", column("2")) == Values{2, 20});  // as Fortran aligns them
  CHECK(values_of("1, 2\n3, 4\n", column("2")) == Values{2, 4});
  CHECK(values_of("\t2\n3\t4\n", column("2")) == Values{2, 4});
  CHECK(values_of("a;b, c\n1;2\n", column("b, c")) == Values{2});
  CHECK(values_of("my value\n1\n2\n") == Values{1, 2});  // blanks within one name
  Request bar = column("2");
  bar.separator = '|';
  CHECK(values_of("1|2\n3|4\n", bar) == Values{2, 4});
  CHECK(values_of("index,\"a, b\",flux\n7,\"x,y\", 5\n7,\"x\"\"y\", 6\n", column("flux")) == Values{5, 6});
}

TEST_CASE("comments and all ends of lines", "[numbers][exact]") {
  const Read r = read_bytes("# made by\n#5\n1\n# between\n2\n");
  CHECK(r.values == Values{1, 2});
  CHECK(r.rows == std::vector<std::int64_t>{3, 5});
  CHECK(r.report.comments == 3);
  CHECK(r.report.bad_rows == 0);
  for (const std::string end : {"\n", "\r\n", "\r", "\r\r\n"}) {
    INFO(static_cast<int>(end[0]) << " " << end.size());
    CHECK(values_of("value" + end + "1" + end + "2" + end) == Values{1, 2});
    CHECK(values_of("1" + end + "2") == Values{1, 2});
    CHECK(values_of("a,b" + end + "1,2" + end + "3,4" + end, column("b")) == Values{2, 4});
  }
  CHECK(values_of("\xef\xbb\xbf"
                  "1\n2\n") == Values{1, 2});
  CHECK(values_of("\xef\xbb\xbfvalue\n1\n2\n") == Values{1, 2});
}

TEST_CASE("rows do not depend on where the buffer ends", "[numbers][exact]") {
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    std::string file = "x" + end;
    Values expected;
    for (int i = 0; i < 400000; ++i) {
      expected.push_back(i);
      file += std::to_string(i) + end;
    }
    const Read r = read_bytes(file);
    CHECK(r.values == expected);
    CHECK(r.report.bad_rows == 0);
    CHECK(r.rows.back() == 400001);
  }
  const std::string endless(3 * buffer_size, '7');
  const Read r = read_bytes("1\n" + endless + "\n2\n");
  CHECK(r.values == Values{1, 2});
  CHECK(r.report.bad_rows == 1);
  CHECK(read_bytes(endless + "\r2\n3\n").values == Values{2, 3});
}

// ---- what is no text of numbers

TEST_CASE("other formats are refused by name, also where raw numbers were announced", "[numbers][exact]") {
  const std::string zeros(40, '\0');
  for (const auto& [begin, name] : std::vector<std::pair<std::string, std::string>>{{"\x1f\x8b\x08\0"s, "gzip"},
                                                                                    {"BZh91AY&SY", "bzip2"},
                                                                                    {"\xfd"
                                                                                     "7zXZ\0"s,
                                                                                     "xz"},
                                                                                    {"\x28\xb5\x2f\xfd", "zstd"},
                                                                                    {"PK\3\4", "zip"},
                                                                                    {"PAR1", "Parquet"},
                                                                                    {"\x89HDF\r\n\x1a\n", "HDF5"},
                                                                                    {"SIMPLE  =", "FITS"},
                                                                                    {"CDF\1", "NetCDF"}}) {
    for (const Format format : {Format::automatic, Format::text, Format::f64, Format::f32, Format::npy}) {
      const Read r = read_bytes(begin + zeros, raw(format));
      INFO(name);
      CHECK((r.refused == Cause::packed || r.refused == Cause::other_format));
      CHECK(r.why.find(name) != std::string::npos);
    }
  }
  const std::string array = npy(dict("'<f8'", "(2,)"), bytes_of<double>({1, 2}));
  for (const Format format : {Format::text, Format::f64, Format::f32}) {
    CHECK(read_bytes(array, raw(format)).refused == Cause::npy);  // was 8.3e249
  }
  CHECK(values_of("BZh\n1\n") == Values{1});
}

TEST_CASE("UTF-16 and UTF-32 are refused by name, with and without a byte order mark", "[numbers][exact]") {
  const std::string text = "flux\r\n1\r\n2\r\n";
  for (const std::size_t width : {2, 4}) {
    for (const bool big : {false, true}) {
      std::string wide;
      for (const char c : text) {
        std::string unit(width, '\0');
        unit[big ? width - 1 : 0] = c;
        wide += unit;
      }
      std::string mark(width, '\0');
      mark[big ? width - 1 : 0] = '\xff';
      mark[big ? width - 2 : 1] = '\xfe';
      for (const std::string& file : {wide, mark + wide}) {
        const Read r = read_bytes(file);
        CHECK(r.refused == Cause::encoding);
        CHECK(r.why.find(width == 2 ? "UTF-16" : "UTF-32") != std::string::npos);
      }
    }
  }
}

// ---- raw numbers

TEST_CASE("raw floats of either size and byte order", "[numbers][exact]") {
  CHECK(values_of(bytes_of<double>({0.5, -2}), raw(Format::f64)) == Values{0.5, -2});
  CHECK(values_of(bytes_of<double>({0.5, -2}, true), raw(Format::f64, ByteOrder::big)) == Values{0.5, -2});
  CHECK(values_of(bytes_of<float>({0.5F, -2}), raw(Format::f32)) == Values{0.5, -2});
  CHECK(values_of(bytes_of<float>({0.5F, -2}, true), raw(Format::f32, ByteOrder::big)) == Values{0.5, -2});
  CHECK(doubts(read_bytes(bytes_of<double>({0.5, -2, 7}, true), raw(Format::f64)), Cause::byte_order));
  CHECK(doubts(read_bytes(bytes_of<float>({0.5F, -2, 7}), raw(Format::f32, ByteOrder::big)), Cause::byte_order));
  CHECK(!doubts(read_bytes(bytes_of<float>({0.5F, -2, 7}), raw(Format::f32)), Cause::byte_order));
  const Read cut = read_bytes(bytes_of<float>({0.5F, -2}) + "ab", raw(Format::f32));
  CHECK(cut.values == Values{0.5, -2});
  CHECK(cut.report.bad_rows == 1);
  Request wrong = raw(Format::f64);
  wrong.column = "1";
  CHECK(read_bytes(bytes_of<double>({1}), wrong).refused == Cause::request);
}
