//! `espalier`: a CT scan of a treelike organ, grown flat.
//!
//! **Architecture Invariant:** arguments, progress and exit codes; no logic. Only this crate prints: results to
//! standard output, progress and errors to standard error.

mod args;
mod cancel;
mod checks;
mod cohort;
mod commands;
mod config;
mod explain;
mod failure;
mod info;
mod progress;
mod summary;

use std::process::ExitCode;

use clap::Parser;
use espalier_model::diagnose::Class;

fn main() -> ExitCode {
    turn_panics_into_exit_code_1();
    cancel::end_on_signals();
    let arguments = match args::Arguments::try_parse_from(std::env::args_os().map(args::shield_point)) {
        Ok(arguments) => arguments.with_all_overrides(),
        Err(error) => return failure::of_arguments(&error),
    };
    if arguments.common.json {
        progress::speak_to_programs(arguments.command.name());
    }
    match commands::execute(&arguments) {
        Ok(()) if progress::results_arrived() => ExitCode::SUCCESS,
        Ok(()) => ExitCode::from(Class::Io.exit_code()),
        Err(error) => failure::last_word(&error),
    }
}

/// A panic is a bug of ours: say so, and end with the code that the documentation gives for one.
fn turn_panics_into_exit_code_1() {
    let print_message = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        let exit_code = Class::Internal.exit_code();
        if progress::is_for_programs() {
            progress::last_line(&format!("this is a bug in espalier; please report it: {info}"), exit_code);
        } else {
            print_message(info);
            progress::last_line("error: this is a bug in espalier; please report the lines above", exit_code);
        }
        std::process::exit(i32::from(exit_code));
    }));
}
