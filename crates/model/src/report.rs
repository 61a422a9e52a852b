//! What a stage did: counts, and warnings for the reader.

/// One counted fact, such as `loops_cut = 3`.
#[derive(Clone, Debug, PartialEq)]
pub struct Count {
    /// What was counted, snake case, with its unit where it has one (`foreground_ml`).
    pub name: &'static str,
    /// How much of it.
    pub value: f64,
}

/// Something the reader should know although the stage went on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// A short stable code such as `W-VOLUME-NO-UNITS`.
    pub code: &'static str,
    /// The place and the fact, lower case, no full stop.
    pub message: String,
}

/// What a stage did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Counted facts, in the order in which they arose.
    pub counts: Vec<Count>,
    /// Warnings, in the order in which they arose.
    pub warnings: Vec<Warning>,
}

impl Report {
    /// Adds a counted fact.
    pub fn count(&mut self, name: &'static str, value: impl Into<f64>) {
        self.counts.push(Count { name, value: value.into() });
    }

    /// Adds a counted fact that is a whole number.
    pub fn count_usize(&mut self, name: &'static str, value: usize) {
        self.counts.push(Count { name, value: value as f64 });
    }

    /// Adds a warning.
    pub fn warn(&mut self, code: &'static str, message: impl Into<String>) {
        self.warnings.push(Warning { code, message: message.into() });
    }

    /// Takes over another report's counts and warnings.
    pub fn extend(&mut self, other: Self) {
        self.counts.extend(other.counts);
        self.warnings.extend(other.warnings);
    }

    /// The value of a count by its name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<f64> {
        self.counts.iter().find(|count| count.name == name).map(|count| count.value)
    }
}
