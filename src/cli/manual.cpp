#include "manual.hpp"

#include <cstddef>
#include <string>
#include <string_view>

#include <CLI/CLI.hpp>

namespace debias::cli {
namespace {

// Text of a man page: a backslash and a minus are letters, a dot or a quote at the start of a line is no macro.
std::string escaped(std::string_view text) {
  std::string result;
  bool at_start = true;
  for (const char c : text) {
    if (at_start && (c == '.' || c == '\'')) result += "\\&";
    if (c == '\\') {
      result += "\\e";
    } else if (c == '-') {
      result += "\\-";
    } else {
      result += c;
    }
    at_start = c == '\n';
  }
  return result;
}

// "-o, --output FILE", or the name of a positional argument.
std::string heading_of(const CLI::Option& option) {
  const bool is_flag = option.get_items_expected_max() == 0;
  std::string names = option.get_name(option.get_positional(), !option.get_positional());
  for (std::size_t comma = names.find(','); comma != std::string::npos; comma = names.find(',', comma + 2)) {
    names.insert(comma + 1, " ");
  }
  return is_flag || option.get_positional() ? names : names + " " + option.get_type_name();
}

std::string options_of(const CLI::App& app) {
  std::string text;
  for (const CLI::Option* option : app.get_options()) {
    text += ".TP\n.B " + escaped(heading_of(*option)) + "\n" + escaped(option->get_description()) + "\n";
  }
  return text;
}

// As it stands: examples and exit codes.
std::string verbatim(const std::string& text) { return ".nf\n" + escaped(text) + "\n.fi\n"; }

// One line for each command and, for commands of commands, their own.
void add_commands(const CLI::App& app, const std::string& name, std::string& text) {
  for (const CLI::App* command : app.get_subcommands({})) {
    const std::string full = name + " " + command->get_name();
    text += ".SS " + escaped(full) + "\n" + escaped(command->get_description()) + ".\n" + options_of(*command);
    const std::string examples = command->get_footer();
    if (!examples.empty()) text += ".PP\n" + verbatim(examples);
    add_commands(*command, full, text);
  }
}

// The words that may follow `name`, as a case of the shell's.
void add_words(const CLI::App& app, const std::string& name, std::string& text) {
  std::string words;
  for (const CLI::App* command : app.get_subcommands({})) words += " " + command->get_name();
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& word : option->get_lnames()) words += " --" + word;
    for (const std::string& word : option->get_snames()) words += " -" + word;
  }
  text += "    '" + name + "') words='" + words.substr(words.empty() ? 0 : 1) + "' ;;\n";
  for (const CLI::App* command : app.get_subcommands({})) {
    add_words(*command, name + (name.empty() ? "" : " ") + command->get_name(), text);
  }
}

}  // namespace

std::string man_page(const CLI::App& app) {
  std::string text = ".TH DEBIAS 1\n.SH NAME\ndebias \\- " + escaped(app.get_description()) +
                     "\n.SH SYNOPSIS\n.B debias\n.I COMMAND\n[options]\n.SH OPTIONS\n" + options_of(app) +
                     ".SH COMMANDS\n";
  add_commands(app, "debias", text);
  return text + ".SH EXIT STATUS\n" + verbatim(app.get_footer());
}

std::string completion(const CLI::App& app) {
  std::string cases;
  add_words(app, "", cases);
  return "_debias() {\n"
         "  local word words='' command='' i\n"
         "  COMPREPLY=()\n"
         "  for ((i = 1; i < COMP_CWORD; i++)); do\n"
         "    word=${COMP_WORDS[i]}\n"
         "    case $word in -*) ;; *) [ \"${#command}\" -gt 0 ] && [ \"$command\" != render ] || "
         "command=\"${command:+$command }$word\" ;; esac\n"
         "  done\n"
         "  case $command in\n" +
         cases +
         "  esac\n"
         "  word=${COMP_WORDS[COMP_CWORD]}\n"
         "  COMPREPLY=($(compgen -W \"$words\" -- \"$word\"))\n"
         "  case $word in -*) ;; *) COMPREPLY+=($(compgen -f -- \"$word\")) ;; esac\n"
         "}\n"
         "complete -o filenames -F _debias debias\n";
}

}  // namespace debias::cli
