//! Tests of the views of a tree.

#![allow(clippy::disallowed_methods, reason = "tests find the data by an environment variable")]
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test may stop and may say what it measured")]

mod closed_form;
mod properties;
mod trees;
