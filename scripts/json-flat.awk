# One line "pointer<tab>value" for each value of a JSON text: /values/0/best/gain	3073.4
# Strings come without quotes, escapes as they stand. For scripts that read what the tools say.
function skip() { while (substr(text, at, 1) ~ /[ \t\r\n]/) at++ }
function string(   from) {
  from = ++at
  while (at <= length(text) && substr(text, at, 1) != "\"") at += substr(text, at, 1) == "\\" ? 2 : 1
  return substr(text, from, at++ - from)
}
function value(pointer,   c, from, n, key) {
  skip()
  c = substr(text, at, 1)
  if (c == "{" || c == "[") {
    at++
    for (n = 0; ; n++) {
      skip()
      if (substr(text, at, 1) == ",") { at++; skip() }
      if (at > length(text) || substr(text, at, 1) == (c == "{" ? "}" : "]")) { at++; return }
      key = n
      if (c == "{") { key = string(); skip(); at++ }
      value(pointer "/" key)
    }
  }
  if (c == "\"") { print pointer "\t" string(); return }
  from = at
  while (at <= length(text) && substr(text, at, 1) !~ /[,}\] \t\r\n]/) at++
  print pointer "\t" substr(text, from, at - from)
}
{ text = text $0 "\n" }
END { at = 1; value("") }
