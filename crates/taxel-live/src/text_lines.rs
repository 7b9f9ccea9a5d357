//! Lines of text out of bytes as they arrive; each byte is in a line or counted.

/// Lines of text, and the bytes that arrived after the last one: at most a line and what was pushed last.
#[derive(Debug)]
pub struct TextLines {
    longest: usize,
    bytes: Vec<u8>,
    /// Number of these bytes that hold no end of a line.
    searched: usize,
    /// Whether they continue a line of which the beginning was returned, as it is too long.
    cut: bool,
    /// Whether the last line ended in a carriage return: a line feed behind it belongs to the same end.
    returned: bool,
    /// The bytes that are in no line, since [`TextLines::take_left_out`].
    pub left_out: LeftOut,
}

/// A line of text, without its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TextLine {
    /// The text; bytes that are no UTF-8 are replaced.
    pub text: String,
    /// Number of its bytes.
    pub bytes: u64,
    /// Whether this is only the beginning of a line that is too long.
    pub cut: bool,
}

impl TextLine {
    /// Whether its bytes are text, and no garbage as of another speed of a serial line.
    #[must_use]
    pub fn is_text(&self) -> bool {
        !self.text.contains(|c: char| c == char::REPLACEMENT_CHARACTER || (c.is_control() && c != '\t'))
    }
}

/// Number of bytes that arrived and that are in no line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LeftOut {
    /// Those that cannot be part of a line.
    pub in_no_line: u64,
    /// Those of lines whose end did not arrive, or whose beginning did not.
    pub unfinished: u64,
}

impl TextLines {
    /// Lines of at most `longest` bytes. A longer line is returned up to there, and its rest is left out.
    #[must_use]
    pub fn new(longest: usize) -> Self {
        Self { longest, bytes: vec![], searched: 0, cut: false, returned: false, left_out: LeftOut::default() }
    }

    /// Appends bytes that arrived.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// The next line, which a line feed, a carriage return or both end, as an Arduino's `println` writes; the last one may lack
    /// its end where no more can arrive (`ended`).
    pub fn next(&mut self, ended: bool) -> Option<TextLine> {
        loop {
            if self.returned && !self.bytes.is_empty() {
                self.remove(usize::from(self.bytes[0] == b'\n'));
                self.returned = false;
            }
            let end = self.bytes[self.searched..].iter().position(|byte| matches!(byte, b'\n' | b'\r'));
            let end = end.map(|place| self.searched + place);
            let length = end.unwrap_or(self.bytes.len());
            if self.cut {
                self.left_out.in_no_line += length as u64;
                self.cut = end.is_none();
                self.remove_line(length, end);
                if self.cut {
                    return None;
                }
                continue;
            }
            let long = length > self.longest;
            if end.is_none() && !long && !(ended && length > 0) {
                self.searched = length;
                return None;
            }
            let length = length.min(self.longest);
            let text = String::from_utf8_lossy(&self.bytes[..length]).into_owned();
            self.cut = long;
            self.remove_line(length, end.filter(|_| !long));
            return Some(TextLine { text, bytes: length as u64, cut: long });
        }
    }

    /// Removes a line of so many bytes, with its end where that is there.
    fn remove_line(&mut self, length: usize, end: Option<usize>) {
        self.returned = end.is_some_and(|end| self.bytes[end] == b'\r');
        self.remove(end.map_or(length, |end| end + 1));
    }

    fn remove(&mut self, bytes: usize) {
        self.bytes.drain(..bytes);
        self.searched = 0;
    }

    /// Number of bytes of the line that has not ended.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.bytes.len()
    }

    /// The bytes that were left out since the last call.
    pub fn take_left_out(&mut self) -> LeftOut {
        std::mem::take(&mut self.left_out)
    }

    /// Leaves out what arrived of a line that has not ended: what comes next does not continue it.
    pub fn discard(&mut self) {
        let place = if self.cut { &mut self.left_out.in_no_line } else { &mut self.left_out.unfinished };
        *place += self.bytes.len() as u64;
        self.remove(self.bytes.len());
        self.cut = false;
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;

    /// The lines of bytes by their definition, each with whether it is only a beginning, and what is left out.
    fn split(bytes: &[u8], longest: usize) -> (Vec<TextLine>, LeftOut) {
        let (mut lines, mut left_out) = (vec![], LeftOut::default());
        let is_second = |k: usize| k > 0 && bytes[k - 1..=k] == *b"\r\n";
        let ends = (0..bytes.len()).filter(|&k| matches!(bytes[k], b'\n' | b'\r') && !is_second(k));
        let mut parts: Vec<&[u8]> = vec![];
        let mut begin = 0;
        for end in ends {
            parts.push(&bytes[begin..end]);
            begin = end + 1 + usize::from(bytes[end..].starts_with(b"\r\n"));
        }
        parts.push(&bytes[begin..]);
        let last = parts.pop().unwrap_or_default();
        if last.len() > longest {
            parts.push(last);
        } else {
            left_out.unfinished = last.len() as u64;
        }
        for part in parts {
            let (line, rest) = part.split_at(part.len().min(longest));
            let text = String::from_utf8_lossy(line).into_owned();
            lines.push(TextLine { text, bytes: line.len() as u64, cut: !rest.is_empty() });
            left_out.in_no_line += rest.len() as u64;
        }
        (lines, left_out)
    }

    #[test]
    fn wherever_the_bytes_are_cut_the_lines_are_the_same_and_few_bytes_are_held() {
        for seed in 0..200 {
            let mut random = StdRng::seed_from_u64(seed);
            let longest = [1, 20, 1000, 1 << 16][random.random_range(0..4)];
            let mut bytes: Vec<u8> = vec![];
            for _ in 0..random.random_range(0..20) {
                let near = longest + random.random_range(0..3) - 1;
                let length = [random.random_range(0..20), longest / 10, near, 5 * longest][random.random_range(0..4)];
                match random.random_range(0..4) {
                    0 => bytes.extend((0..length).map(|_| random.random::<u8>())),
                    kind => bytes.extend(std::iter::repeat_n([b'1', 0, 0xff][kind - 1], length)),
                }
                bytes.extend([&b"\n"[..], b"\r\n", b"\r", b""][random.random_range(0..4)]);
            }
            let (mut reader, mut lines, mut rest) = (TextLines::new(longest), vec![], &bytes[..]);
            let most = [1, 7, 4096][random.random_range(0..3)].max(longest / 100);
            while !rest.is_empty() {
                let piece = random.random_range(1..=most).min(rest.len());
                reader.push(&rest[..piece]);
                rest = &rest[piece..];
                lines.extend(std::iter::from_fn(|| reader.next(false)));
                assert!(reader.waiting() <= longest, "seed {seed}: {}", reader.waiting());
            }
            assert!(
                reader.bytes.capacity() <= 4 * longest.max(most).max(2),
                "seed {seed}: {}",
                reader.bytes.capacity()
            );
            reader.discard();
            let (expected, left_out) = split(&bytes, longest);
            assert!(lines == expected, "seed {seed}");
            assert_eq!(reader.take_left_out(), left_out, "seed {seed}");
            assert_eq!(reader.take_left_out(), LeftOut::default());
        }
    }

    #[test]
    fn both_characters_end_one_line_also_where_they_arrive_apart_and_the_last_one_may_lack_its_end() {
        let mut lines = TextLines::new(8);
        lines.push(b"1,2\r");
        let first = lines.next(false).unwrap();
        lines.push(b"\n\r\n3,4");
        let texts: Vec<String> = std::iter::from_fn(|| lines.next(true)).map(|line| line.text).collect();
        assert_eq!((&*first.text, &texts[..]), ("1,2", &["".to_owned(), "3,4".to_owned()][..]));
        assert_eq!((lines.waiting(), lines.take_left_out()), (0, LeftOut::default()));
    }
}
