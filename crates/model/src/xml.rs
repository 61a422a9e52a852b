//! Text inside of XML.

/// A text with what XML gives a meaning to, or forbids, replaced: as character data or inside of double quotes.
#[must_use]
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            // Not even as a reference are most control characters legal in XML 1.0.
            control if control.is_control() || matches!(control, '\u{FFFE}' | '\u{FFFF}') => {
                escaped.push(' ');
            }
            plain => escaped.push(plain),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_left_that_xml_would_read() {
        assert_eq!(escape("a<b & \"c\">\u{1}\u{FFFF}é"), "a&lt;b &amp; &quot;c&quot;&gt;  é");
    }
}
