//! One claim, what was found in its place, and whether they agree.

use std::fmt;

/// A number, a count or a word.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A measured number.
    Number(f64),
    /// How many.
    Count(usize),
    /// A word or a phrase.
    Text(String),
}

impl fmt::Display for Value {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            // Nine digits: more than any tolerance here asks for, few enough for a table.
            Self::Number(number) if *number != 0.0 && !(1e-4..1e9).contains(&number.abs()) => {
                write!(formatter, "{number:.8e}")
            }
            Self::Number(number) => write!(formatter, "{number:.9}"),
            Self::Count(count) => write!(formatter, "{count}"),
            Self::Text(text) => formatter.write_str(text),
        }
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<usize> for Value {
    fn from(count: usize) -> Self {
        Self::Count(count)
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Value {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

/// How a check came out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The claim holds.
    Holds,
    /// It does not.
    Fails,
    /// It could not be tested, for the reason that stands in the place of what was found.
    Untested,
}

impl Outcome {
    /// The word for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Fails => "FAILS",
            Self::Untested => "untested",
        }
    }
}

/// A claim and its test.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// What is claimed, such as `stress`.
    pub name: String,
    /// What the files state.
    pub stated: Value,
    /// What was found from the written numbers.
    pub found: Value,
    /// By how much the two may differ; `None` where they must be the same.
    pub tolerance: Option<f64>,
    /// Whether they agree.
    pub outcome: Outcome,
}

impl Check {
    /// Two values that must be the same.
    #[must_use]
    pub fn same(name: impl Into<String>, stated: impl Into<Value>, found: impl Into<Value>) -> Self {
        let (stated, found) = (stated.into(), found.into());
        let outcome = if stated == found { Outcome::Holds } else { Outcome::Fails };
        Self { name: name.into(), stated, found, tolerance: None, outcome }
    }

    /// Two numbers that may differ by a tolerance.
    #[must_use]
    pub fn near(name: impl Into<String>, stated: f64, found: f64, tolerance: f64) -> Self {
        let is_near = (stated - found).abs() <= tolerance;
        let outcome = if is_near { Outcome::Holds } else { Outcome::Fails };
        Self {
            name: name.into(),
            stated: stated.into(),
            found: found.into(),
            tolerance: Some(tolerance),
            outcome,
        }
    }

    /// A claim in words and what was found in its place: nothing, if it holds.
    #[must_use]
    pub fn unless(name: impl Into<String>, stated: impl Into<Value>, fault: Option<String>) -> Self {
        let outcome = if fault.is_none() { Outcome::Holds } else { Outcome::Fails };
        let found = fault.unwrap_or_else(|| "so it is".to_owned()).into();
        Self { name: name.into(), stated: stated.into(), found, tolerance: None, outcome }
    }

    /// A claim that cannot be tested here.
    #[must_use]
    pub fn untested(name: impl Into<String>, stated: impl Into<Value>, why: &str) -> Self {
        let (stated, found) = (stated.into(), why.into());
        Self { name: name.into(), stated, found, tolerance: None, outcome: Outcome::Untested }
    }

    /// Whether it does not hold.
    #[must_use]
    pub fn fails(&self) -> bool {
        self.outcome == Outcome::Fails
    }
}
