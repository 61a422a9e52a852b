//! What the program says of an error: code, place, cause and way out, to people or to programs.

use std::process::ExitCode;

use espalier_model::Diagnose;
use espalier_model::diagnose::Class;
use espalier_pipeline::Error;
use espalier_pipeline::event_lines::{Failure, Line};

use crate::progress;

/// The code of a command line that cannot be understood, or whose parts do not fit together.
const USAGE: &str = "E-USAGE";

/// Prints the error that ends the program, and gives its exit code.
pub(crate) fn last_word(error: &anyhow::Error) -> ExitCode {
    match error.downcast_ref::<Error>() {
        Some(known) => {
            report(known);
            ExitCode::from(known.class().exit_code())
        }
        None => usage(&error.to_string()),
    }
}

/// Prints an error of the pipeline.
pub(crate) fn report(error: &Error) {
    if progress::is_for_programs() {
        progress::tell(&Line::Failed(Failure::of(error)));
    } else {
        print(error.code(), &error.to_string(), &error.hint());
    }
}

/// Prints what is wrong with a command line, and gives its exit code.
pub(crate) fn usage(message: &str) -> ExitCode {
    let (exit_code, message) = (Class::Usage.exit_code(), message.trim_end());
    if progress::is_for_programs() {
        progress::tell(&Line::Failed(Failure::with_code(USAGE, exit_code, message.to_owned())));
    } else {
        print(USAGE, message, "");
    }
    ExitCode::from(exit_code)
}

/// Prints what `clap` says of arguments: help and version are results, anything else is an error like all others.
pub(crate) fn of_arguments(error: &clap::Error) -> ExitCode {
    if !error.use_stderr() {
        progress::arrived(error.print());
        return if progress::results_arrived() {
            ExitCode::SUCCESS
        } else {
            ExitCode::from(Class::Io.exit_code())
        };
    }
    // It knows the options, but not what was asked for before it was wrong.
    if std::env::args_os().any(|argument| argument == "--json") {
        progress::speak_to_programs("");
    }
    let said = error.render().to_string();
    match said.strip_prefix("error: ") {
        Some(message) => usage(message),
        // Asked to do nothing, it shows the help.
        None => {
            progress::line(said.trim_end());
            usage("there is no command")
        }
    }
}

fn print(code: &str, message: &str, hint: &str) {
    progress::line(&format!("error[{code}]: {message}"));
    if !hint.is_empty() {
        progress::line(&format!("  hint: {hint}"));
    }
    if code != USAGE && espalier_pipeline::explain::is_worth_reading(code, hint) {
        progress::line(&format!("  more: espalier explain {code}"));
    }
}
