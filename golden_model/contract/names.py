"""Which names units, ports, fields and registers may have: no keyword of a language in which they stand as they are.

A name may be escaped in some languages, but not in all, and not by everything that writes them.
"""

import keyword
import re

NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
"""VHDL knows no upper case and no two underscores in a row; C++ keeps the latter for itself."""


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


SYSTEM_VERILOG = _words("""
    accept_on alias always always_comb always_ff always_latch and assert assign assume automatic before begin bind bins
    binsof bit break buf bufif0 bufif1 byte case casex casez cell chandle checker class clocking cmos config const
    constraint context continue cover covergroup coverpoint cross deassign default defparam design disable dist do edge
    else end endcase endchecker endclass endclocking endconfig endfunction endgenerate endgroup endinterface endmodule
    endpackage endprimitive endprogram endproperty endsequence endspecify endtable endtask enum event eventually expect
    export extends extern final first_match for force foreach forever fork forkjoin function generate genvar global
    highz0 highz1 if iff ifnone ignore_bins illegal_bins implements implies import incdir include initial inout input
    inside instance int integer interconnect interface intersect join join_any join_none large let liblist library local
    localparam logic longint macromodule matches medium modport module nand negedge nettype new nexttime nmos nor
    noshowcancelled not notif0 notif1 null or output package packed parameter pmos posedge primitive priority program
    property protected pull0 pull1 pulldown pullup pulsestyle_ondetect pulsestyle_onevent pure rand randc randcase
    randsequence rcmos real realtime ref reg reject_on release repeat restrict return rnmos rpmos rtran rtranif0
    rtranif1 s_always s_eventually s_nexttime s_until s_until_with scalared sequence shortint shortreal showcancelled
    signed small soft solve specify specparam static string strong strong0 strong1 struct super supply0 supply1
    sync_accept_on sync_reject_on table tagged task this throughout time timeprecision timeunit tran tranif0 tranif1 tri
    tri0 tri1 triand trior trireg type typedef union unique unique0 unsigned until until_with untyped use uwire var
    vectored virtual void wait wait_order wand weak weak0 weak1 while wildcard wire with within wor xnor xor
""")
"""IEEE 1800-2023, annex B; Verilog's are among them."""

VHDL = _words("""
    abs access after alias all and architecture array assert assume assume_guarantee attribute begin block body buffer
    bus case component configuration constant context cover default disconnect downto else elsif end entity exit
    fairness file for force function generate generic group guarded if impure in inertial inout is label library linkage
    literal loop map mod nand new next nor not null of on open or others out package parameter port postponed private
    procedure process property protected pure range record register reject release rem report restrict
    restrict_guarantee return rol ror select sequence severity shared signal sla sll sra srl strong subtype then to
    transport type unaffected units until use variable view vmode vpkg vprop vunit wait when while with xnor xor
""")
"""IEEE 1076-2019, 15.10, and what 1076-2008 had besides."""

SYSTEM_RDL = _words("""
    abstract accesstype addressingtype addrmap alias all alternate bit boolean bothedge byte compact component
    componentwidth constraint default encode enum external false field fullalign hw inside int internal level longint
    mem na negedge nonsticky number onreadtype onwritetype posedge precedencetype property r rclr real ref reg regalign
    regfile rset ruser rw rw1 shortint shortreal signal signed string struct sw this true type unsigned w w1 wclr with
    within woclr woset wot wr wset wuser wzc wzs wzt
""")
"""SystemRDL 2.0, 4.4."""

C = _words("""
    alignas alignof auto bool break case char const constexpr continue default do double else enum extern false float
    for goto if inline int long nullptr register restrict return short signed sizeof static static_assert struct switch
    thread_local true typedef typeof typeof_unqual union unsigned void volatile while
""")
"""ISO/IEC 9899:2024, 6.4.1, but for those that begin with an underscore."""

CPP = _words("""
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char char16_t char32_t char8_t class co_await
    co_return co_yield compl concept const const_cast consteval constexpr constinit continue decltype default delete do
    double dynamic_cast else enum explicit export extern false float for friend goto if inline int long mutable
    namespace new noexcept not not_eq nullptr operator or or_eq private protected public register reinterpret_cast
    requires return short signed sizeof static static_assert static_cast struct switch template this thread_local throw
    true try typedef typeid typename union unsigned using virtual void volatile wchar_t while xor xor_eq
""")
"""ISO/IEC 14882:2024, [lex.key] and the alternative tokens of [lex.digraph]."""

KEYWORDS = {
    "SystemVerilog": SYSTEM_VERILOG,
    "VHDL": VHDL,
    "SystemRDL": SYSTEM_RDL,
    "C": C,
    "C++": CPP,
    "Python": frozenset(keyword.kwlist),
}
"""By language."""
OF_PORTS = tuple(KEYWORDS)
"""The languages in which modules and their ports stand, in our files or in those of who uses them."""
OF_FIELDS = ("C", "C++", "Python")
"""Those in which fields of payloads are; in all others they are parts of longer names."""
OF_REGISTERS = ("SystemRDL", "C", "C++")
"""Those in which registers, their fields and values are."""


def check_name(what: str, name: str, languages: tuple[str, ...]) -> None:
    """Raises ValueError for a name that cannot be used in these languages; `what`, such as "port", is called so."""
    if not NAME.fullmatch(name):
        raise ValueError(f"{what} {name!r}: a name is words of a to z and 0 to 9, joined by single underscores")
    taken = [language for language in languages if name in KEYWORDS[language]]
    if taken:
        raise ValueError(f"{what} {name!r}: a keyword of {', '.join(taken)}; choose another name")
